"""Records as CSV: the header others rely on, exact numbers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from eddyscan.core.errors import FileError, GeometryError, InputError
from eddyscan.core.frames import apply, rotation_about_z, transform
from eddyscan.core.record import ScanRecord
from eddyscan.formats.records import export_record


def record_of(readings: int = 12, seed: int = 7) -> ScanRecord:
    rng = np.random.default_rng(seed)
    T_stage_part = transform(rotation_about_z(12.5), (11.0, -3.0, 7.0))
    part = rng.uniform(0, 100, (readings, 3))
    stage = apply(T_stage_part, part)
    return ScanRecord(
        row=np.arange(readings) // 4,
        point=np.arange(readings) % 4,
        time_s=np.sort(rng.uniform(0, 60, readings)),
        stage_mm=stage,
        target_mm=stage + rng.normal(0, 0.002, stage.shape),
        frequency_hz=np.full(readings, 5e5),
        impedance_ohm=rng.normal(2, 0.1, readings) + 1j * rng.normal(40, 0.1, readings),
        flag=rng.integers(0, 3, readings),
        meta={"T_stage_part": T_stage_part.tolist()},
    )


def test_the_header_is_the_published_one(tmp_path: Path) -> None:
    file = export_record(record_of(), "csv", tmp_path / "r.csv")
    assert file.read_text().splitlines()[0] == (
        "reading,row,point,time_s,x_mm,y_mm,z_mm,x_stage_mm,y_stage_mm,z_stage_mm,"
        "frequency_hz,resistance_ohm,reactance_ohm,lift_off_mm,flag"
    )


def test_every_number_stands_in_its_column(tmp_path: Path) -> None:
    record = record_of()
    lift = np.linspace(0.4, 0.6, len(record))
    lift[3] = np.nan
    export_record(record, "csv", tmp_path / "r.csv", lift_off_mm=lift)
    with (tmp_path / "r.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert [int(line["reading"]) for line in lines] == list(range(len(record)))
    for name, column in (("row", record.row), ("point", record.point), ("flag", record.flag)):
        assert [int(line[name]) for line in lines] == list(column)
    exact = {
        "time_s": record.time_s,
        "frequency_hz": record.frequency_hz,
        "resistance_ohm": record.impedance_ohm.real,
        "reactance_ohm": record.impedance_ohm.imag,
        "x_mm": record.part_mm[:, 0],
        "z_mm": record.part_mm[:, 2],
        "y_stage_mm": record.stage_mm[:, 1],
    }
    for name, column in exact.items():
        assert [float(line[name]) for line in lines] == list(column), name
    assert lines[3]["lift_off_mm"] == ""
    assert float(lines[4]["lift_off_mm"]) == lift[4]


def test_lift_off_of_another_record_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GeometryError, match="5 lift-off values for 12 readings"):
        export_record(record_of(), "csv", tmp_path / "r.csv", lift_off_mm=np.zeros(5))
    assert not list(tmp_path.iterdir())


def test_unknown_format_and_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written as 'xls'; known are csv"):
        export_record(record_of(), "xls", tmp_path / "r.xls")
    with pytest.raises(FileError, match=r"does not exist\. Make it first"):
        export_record(record_of(), "csv", tmp_path / "no" / "r.csv")
