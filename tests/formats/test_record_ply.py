"""The C-scan as PLY: whole both ways, readable by others, honest about damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from record_examples import a_cscan, a_record

from eddyscan.core.cscan import CScan
from eddyscan.core.errors import FileError, GeometryError
from eddyscan.formats.record_ply import read_cscan_ply, write_cscan_ply
from eddyscan.formats.records import export_record


@pytest.mark.parametrize("uncertain", [True, False])
def test_reads_back_bit_for_bit(tmp_path: Path, uncertain: bool) -> None:
    given = a_cscan(uncertain=uncertain)
    write_cscan_ply(given, tmp_path / "c.ply")
    back = read_cscan_ply(tmp_path / "c.ply")
    for name in ("vertices", "faces", "normals"):
        np.testing.assert_array_equal(getattr(back.mesh, name), getattr(given.mesh, name))
    np.testing.assert_array_equal(back.covered, given.covered)
    assert list(back.channels) == list(given.channels)
    for name, values in given.channels.items():
        np.testing.assert_array_equal(back.channels[name], values)
    assert (back.mesh.uncertainty_mm is None) is not uncertain
    assert back.mesh.frame == "part"


def test_another_reader_sees_the_same_mesh_and_channels(tmp_path: Path) -> None:
    import trimesh

    given = a_cscan()
    write_cscan_ply(given, tmp_path / "c.ply")
    other = trimesh.load(tmp_path / "c.ply", process=False)
    np.testing.assert_allclose(other.vertices, given.mesh.vertices)
    np.testing.assert_array_equal(other.faces, given.mesh.faces)
    data = other.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(data["residual_ohm"].ravel(), given.channels["residual_ohm"])


@pytest.mark.parametrize("keep", [0.5, 0.95, 0.999])
def test_a_truncated_file_says_how_much_is_missing(tmp_path: Path, keep: float) -> None:
    path = tmp_path / "c.ply"
    write_cscan_ply(a_cscan(), path)
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data))])
    with pytest.raises(FileError, match=r"c\.ply is truncated: \d+ of \d+ bytes"):
        read_cscan_ply(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.ply"
    with pytest.raises(FileError, match="there is no C-scan"):
        read_cscan_ply(path)
    path.write_bytes(b"")
    with pytest.raises(FileError, match=r"0 bytes\) is not a PLY file"):
        read_cscan_ply(path)
    path.write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n" + bytes(12)
    )
    with pytest.raises(FileError, match="mesh without C-scan"):
        read_cscan_ply(path)
    path.write_bytes(b"ply\nformat ascii 1.0\nelement vertex 0\nelement face 0\nend_header\n")
    with pytest.raises(FileError, match="not a binary little-endian PLY"):
        read_cscan_ply(path)


def test_a_channel_that_no_ply_can_name_is_refused(tmp_path: Path) -> None:
    given = a_cscan()
    odd = CScan(given.mesh, given.covered, {"lift off [mm]": np.zeros(len(given.covered))})
    with pytest.raises(GeometryError, match=r"'lift off \[mm\]' cannot be a PLY property"):
        write_cscan_ply(odd, tmp_path / "c.ply")


def test_a_record_without_cscan_becomes_points_another_reader_sees(tmp_path: Path) -> None:
    import trimesh

    record = a_record()
    lift = np.linspace(0.4, 0.6, len(record))
    export_record(record, "ply", tmp_path / "r.ply", lift_off_mm=lift)
    other = trimesh.load(tmp_path / "r.ply", process=False)
    np.testing.assert_allclose(other.vertices, record.part_mm)
    data = other.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(data["reactance_ohm"].ravel(), record.impedance_ohm.imag)
    np.testing.assert_array_equal(data["lift_off_mm"].ravel(), lift)
