""".nde 4.3: the published rules kept, everything back, files of other makers read."""

from __future__ import annotations

import copy
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from record_examples import a_record, assert_same_readings

from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.record import OVERLOAD
from eddyscan.formats.record_nde import read_nde, write_nde
from eddyscan.formats.record_nde_rules import broken_rules

CREATED = datetime(2026, 11, 22, 9, 0, tzinfo=UTC)


def tables(path: Path) -> dict[str, Any]:
    with h5py.File(path) as file:
        return {"/Properties": json.loads(file["Properties"][()]), "/Setup": json.loads(file["Public/Setup"][()])}


@pytest.mark.parametrize("frequencies_hz", [(5e5,), (11e6, 12e6, 13e6)])
def test_the_record_comes_back_whole(tmp_path: Path, frequencies_hz: tuple[float, ...]) -> None:
    given = a_record(30, frequencies_hz=frequencies_hz)
    write_nde(given, tmp_path / "r.nde", created=CREATED)
    back = read_nde(tmp_path / "r.nde")
    assert_same_readings(given, back)
    np.testing.assert_array_equal(back.target_mm, given.target_mm)
    assert back.meta == given.meta


def test_the_tables_keep_the_published_rules(tmp_path: Path) -> None:
    write_nde(a_record(30, frequencies_hz=(5e5, 1e6)), tmp_path / "r.nde", created=CREATED)
    for name, table in tables(tmp_path / "r.nde").items():
        assert broken_rules(name, table) == []


def test_a_record_that_notes_nothing_still_keeps_the_rules(tmp_path: Path) -> None:
    given = a_record(1)
    given.meta.clear()
    given.meta["T_stage_part"] = np.eye(4).tolist()
    write_nde(given, tmp_path / "r.nde", created=CREATED)
    written = tables(tmp_path / "r.nde")
    assert [broken_rules(name, table) for name, table in written.items()] == [[], []]
    assert "the drive amplitude was not recorded" in written["/Properties"]["file"]["description"]


def test_every_path_in_the_setup_leads_to_data_of_the_stated_shape(tmp_path: Path) -> None:
    given = a_record(30, frequencies_hz=(5e5, 1e6))
    write_nde(given, tmp_path / "r.nde", created=CREATED)
    setup = tables(tmp_path / "r.nde")["/Setup"]
    stated = [d for group in setup["groups"] for d in group["datasets"]]
    stated += [d for mapping in setup["dataMappings"] for d in mapping["allCycle"]["datasets"]]
    assert len(stated) == 2 * (2 + 3)
    with h5py.File(tmp_path / "r.nde") as file:
        for dataset in stated:
            assert file[dataset["path"]].shape == tuple(axis["quantity"] for axis in dataset["dimensions"])
        assert file["Public/Groups/0/Datasets/0-Impedance"].dtype == np.complex128
        np.testing.assert_allclose(file["Public/Groups/0/Datasets/2-Encoder"][()], 1e-3 * given.stage_mm[::2, 0])


def test_ids_refer_to_what_exists(tmp_path: Path) -> None:
    write_nde(a_record(9), tmp_path / "r.nde", created=CREATED)
    setup = tables(tmp_path / "r.nde")["/Setup"]
    ids = {key: {entry["id"] for entry in setup[key]} for key in ("probes", "wedges", "specimens", "dataMappings")}
    process = setup["groups"][0]["processes"][0]
    assert process["eddyCurrent"]["probeId"] in ids["probes"]
    assert process["dataMappingId"] in ids["dataMappings"]
    assert setup["probes"][0]["wedgeAssociation"]["wedgeId"] in ids["wedges"]
    assert setup["dataMappings"][0]["specimenId"] in ids["specimens"]
    assert process["eddyCurrent"]["driveAmplitude"] == pytest.approx(2**0.5)
    assert setup["motionDevices"][0]["encoder"]["stepResolution"] == pytest.approx(1e7)


def test_status_marks_missing_and_saturated_readings(tmp_path: Path) -> None:
    given = a_record(6)
    given.flag[:] = 0
    given.flag[2] = OVERLOAD
    given.impedance_ohm[4] = np.nan
    write_nde(given, tmp_path / "r.nde", created=CREATED)
    with h5py.File(tmp_path / "r.nde") as file:
        status = file["Public/Groups/0/Datasets/1-ImpedanceStatus"][0]
    assert status.tolist() == [1, 1, 3, 1, 0, 1]


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda s: s.pop("groups"), "'groups' is a required property"),
        (lambda s: s.update(flavour="sweet"), "Additional properties are not allowed"),
        (lambda s: s["probes"][0].pop("wedgeAssociation"), "'wedgeAssociation' is a required property"),
        (lambda s: s["groups"][0]["processes"][0].pop("inputs"), "'inputs' is a required property"),
        (lambda s: s["acquisitionUnits"][0].update(acquisitionRate=0), "less than or equal to the minimum of 0"),
        (lambda s: s["dataMappings"][0]["allCycle"].update(datasets=[]), "should be non-empty"),
    ],
)
def test_the_rules_see_what_breaks_them(tmp_path: Path, spoil: Any, told: str) -> None:
    write_nde(a_record(9), tmp_path / "r.nde", created=CREATED)
    setup = copy.deepcopy(tables(tmp_path / "r.nde")["/Setup"])
    spoil(setup)
    assert any(told in fault for fault in broken_rules("/Setup", setup))


def test_a_file_of_another_maker_is_read_by_its_encoders(tmp_path: Path) -> None:
    given = a_record(30)
    path = tmp_path / "r.nde"
    write_nde(given, path, created=CREATED)
    with h5py.File(path, "a") as file:
        del file["Private"]
    back = read_nde(path)
    np.testing.assert_array_equal(back.impedance_ohm, given.impedance_ohm)
    np.testing.assert_allclose(back.stage_mm, given.stage_mm, atol=1e-9)
    assert back.time_s[-1] == pytest.approx(np.ptp(given.time_s))
    assert back.meta["unit"] == "Ohm"


def test_other_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "r.nde"
    with pytest.raises(FileError, match="there is no file"):
        read_nde(path)
    path.write_bytes(b"junk")
    with pytest.raises(FileError, match="truncated or of another kind"):
        read_nde(path)
    with h5py.File(path, "w") as file:
        file["music"] = 1
    with pytest.raises(FileError, match="without /Public/Setup"):
        read_nde(path)
    with h5py.File(path, "w") as file:
        file["Public/Setup"] = json.dumps({"groups": [{"id": 0, "datasets": [], "processes": []}]})
    with pytest.raises(FileError, match="holds no eddy-current impedance"):
        read_nde(path)


def test_an_empty_record_is_refused_before_a_file_is_made(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match="at least one"):
        write_nde(a_record(0), tmp_path / "r.nde", created=CREATED)
    assert not list(tmp_path.iterdir())
