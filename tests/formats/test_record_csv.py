"""Records as CSV: the header others rely on, exact numbers."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from record_examples import a_record, assert_same_readings

from eddyscan.core.errors import FileError, GeometryError, InputError
from eddyscan.formats.records import export_record, read_record_csv


def test_the_header_is_the_published_one(tmp_path: Path) -> None:
    file = export_record(a_record(), "csv", tmp_path / "r.csv")
    assert file.read_text().splitlines()[0] == (
        "reading,row,point,time_s,x_mm,y_mm,z_mm,x_stage_mm,y_stage_mm,z_stage_mm,"
        "frequency_hz,resistance_ohm,reactance_ohm,lift_off_mm,flag"
    )


def test_every_number_stands_in_its_column(tmp_path: Path) -> None:
    record = a_record()
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
        export_record(a_record(), "csv", tmp_path / "r.csv", lift_off_mm=np.zeros(5))
    assert not list(tmp_path.iterdir())


def test_unknown_format_and_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written as 'xls'; known are csv, nde, hdf5, ply"):
        export_record(a_record(), "xls", tmp_path / "r.xls")
    with pytest.raises(FileError, match=r"does not exist\. Make it first"):
        export_record(a_record(), "csv", tmp_path / "no" / "r.csv")


def test_reads_back_bit_for_bit_with_pose_and_lift_off(tmp_path: Path) -> None:
    given = a_record()
    lift = np.linspace(0.4, 0.6, len(given))
    back = read_record_csv(export_record(given, "csv", tmp_path / "r.csv", lift_off_mm=lift))
    assert_same_readings(given, back)
    np.testing.assert_allclose(back.T_stage_part, given.T_stage_part, atol=1e-10)
    np.testing.assert_allclose(back.part_mm, given.part_mm, atol=1e-9)
    assert back.meta["lift_off_mm"] == lift.tolist()


def test_a_reading_without_value_stays_without(tmp_path: Path) -> None:
    given = a_record()
    given.impedance_ohm[3] = np.nan
    back = read_record_csv(export_record(given, "csv", tmp_path / "r.csv"))
    assert np.flatnonzero(np.isnan(back.impedance_ohm)).tolist() == [3]


def test_a_cut_line_is_named(tmp_path: Path) -> None:
    path = export_record(a_record(), "csv", tmp_path / "r.csv")
    path.write_text(path.read_text()[:-40])
    with pytest.raises(FileError, match=r"line 13 has \d+ cells, the first line has 15.*truncated or damaged there"):
        read_record_csv(path)


def test_a_word_among_the_numbers_is_named(tmp_path: Path) -> None:
    path = export_record(a_record(), "csv", tmp_path / "r.csv")
    lines = path.read_text().splitlines()
    lines[5] = lines[5].replace("500000.0", "fast")
    path.write_text("\n".join(lines))
    with pytest.raises(FileError, match="line 6: 'fast' is not a number"):
        read_record_csv(path)
