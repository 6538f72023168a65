"""The archive: everything back, everything explained, damage named."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from record_examples import a_cscan, a_record, assert_same_readings

from eddyscan.core.errors import FileError
from eddyscan.formats.record_hdf5 import read_hdf5
from eddyscan.formats.records import export_record


def test_record_lift_off_and_cscan_come_back_bit_for_bit(tmp_path: Path) -> None:
    record, cscan = a_record(200), a_cscan()
    lift = np.linspace(0.4, 0.6, len(record))
    archive = read_hdf5(export_record(record, "hdf5", tmp_path / "a.h5", lift_off_mm=lift, cscan=cscan))
    assert_same_readings(record, archive.record)
    np.testing.assert_array_equal(archive.record.target_mm, record.target_mm)
    assert archive.record.meta == record.meta
    assert archive.lift_off_mm is not None
    assert archive.cscan is not None
    np.testing.assert_array_equal(archive.lift_off_mm, lift)
    np.testing.assert_array_equal(archive.cscan.mesh.vertices, cscan.mesh.vertices)
    np.testing.assert_array_equal(archive.cscan.mesh.uncertainty_mm, cscan.mesh.uncertainty_mm)
    np.testing.assert_array_equal(archive.cscan.covered, cscan.covered)
    for name, values in cscan.channels.items():
        np.testing.assert_array_equal(archive.cscan.channels[name], values)


def test_a_record_alone_is_an_archive_too(tmp_path: Path) -> None:
    archive = read_hdf5(export_record(a_record(), "hdf5", tmp_path / "a.h5"))
    assert archive.lift_off_mm is None
    assert archive.cscan is None


def test_every_array_states_unit_and_meaning(tmp_path: Path) -> None:
    path = export_record(a_record(), "hdf5", tmp_path / "a.h5", cscan=a_cscan())
    mute: list[str] = []

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset) and name != "meta" and not {"units", "description"} <= set(item.attrs):
            mute.append(name)

    with h5py.File(path) as file:
        file.visititems(look)
        assert file["readings/stage_mm"].attrs["units"] == "mm"
        assert file["readings/stage_mm"].attrs["frame"] == "stage"
        np.testing.assert_allclose(file["readings/part_mm"][()], a_record().part_mm)
    assert mute == []


def test_other_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(FileError, match="there is no archive"):
        read_hdf5(path)
    path.write_bytes(b"not hdf5")
    with pytest.raises(FileError, match="truncated or of another kind"):
        read_hdf5(path)
    with h5py.File(path, "w") as file:
        file["music"] = 1
    with pytest.raises(FileError, match="another kind, not an eddyscan archive"):
        read_hdf5(path)
    whole = export_record(a_record(500), "hdf5", tmp_path / "b.h5").read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FileError, match="truncated or of another kind"):
        read_hdf5(path)
