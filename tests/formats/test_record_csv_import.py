"""CSV records made elsewhere: many spellings, one record; the real scans when they are there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.errors import FileError, InputError
from eddyscan.core.record import POSITION_DOUBTFUL
from eddyscan.formats.record_csv_import import csv_channels, frequency_in, read_record_csv
from eddyscan.formats.record_rows import rows_along

DATA = Path(os.environ.get("EDDYSCAN_DATA", Path(__file__).resolve().parents[2] / "../shared/data"))


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("header", ["x_mm,y_mm,z", "x (mm),y (mm),z (ohm)", "X,Y,Spec 5e5 Hz"])
def test_complex_text_under_many_names(tmp_path: Path, header: str) -> None:
    path = write(tmp_path / "r.csv", f"{header}\n1.0,2.0,(1.5-2j)\n1.5,2.0,3+4j\n")
    record = read_record_csv(path)
    np.testing.assert_array_equal(record.impedance_ohm, [1.5 - 2j, 3 + 4j])
    np.testing.assert_array_equal(record.part_mm, [[1.0, 2.0, 0.0], [1.5, 2.0, 0.0]])


def test_a_pair_of_real_columns_with_three_axes_and_time(tmp_path: Path) -> None:
    path = write(tmp_path / "r.csv", "time_s,x,y,z,real,imag\n0.5,1,2,3,4,5\n0.6,2,2,3,4,-5\n")
    record = read_record_csv(path)
    np.testing.assert_array_equal(record.impedance_ohm, [4 + 5j, 4 - 5j])
    np.testing.assert_array_equal(record.stage_mm, [[1, 2, 3], [2, 2, 3]])
    np.testing.assert_array_equal(record.time_s, [0.5, 0.6])
    assert (record.flag == 0).all()


def test_several_channels_want_a_choice(tmp_path: Path) -> None:
    path = write(tmp_path / "r.csv", "x,y,a 1MHz,b 2MHz\n0,0,1j,2j\n1,0,1j,2j\n")
    assert csv_channels(path) == ("a 1MHz", "b 2MHz")
    with pytest.raises(InputError, match=r"holds 2 channels: 'a 1MHz', 'b 2MHz'\. Choose one"):
        read_record_csv(path)
    record = read_record_csv(path, channel="b 2MHz")
    assert (record.impedance_ohm == 2j).all()
    assert (record.frequency_hz == 2e6).all()
    with pytest.raises(InputError, match="holds no channel 'c'"):
        read_record_csv(path, channel="c")


def test_a_file_without_header_is_named_by_the_reader(tmp_path: Path) -> None:
    path = write(tmp_path / "r.csv", "0,-0.01,0.02\n0.004,-0.02,0.03\n")
    record = read_record_csv(path, columns=("time_s", "real", "imag"))
    np.testing.assert_allclose(record.impedance_ohm, [-0.01 + 0.02j, -0.02 + 0.03j])
    assert np.isnan(record.stage_mm).all()
    assert (record.flag == POSITION_DOUBTFUL).all()
    with pytest.raises(InputError, match="has 3 columns, 2 names were given"):
        read_record_csv(path, columns=("a", "b"))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "holds 0 lines; a header and at least one reading"),
        ("x,y,z\n1,2,3\n", "has no complex column; its columns are x, y, z"),
        ("x,y,s\n1,2,(1+\n", r"column 's', reading 1: '\(1\+' is not a number"),
        ("x,y,s\n1,2,1j\n1,2\n", "line 3 has 2 cells, the first line has 3"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(FileError, match=told):
        read_record_csv(write(tmp_path / "r.csv", text))


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="there is no file"):
        read_record_csv(tmp_path / "none.csv")
    (tmp_path / "b.csv").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(FileError, match="is not a text file: byte 0"):
        read_record_csv(tmp_path / "b.csv")


def test_frequencies_are_read_from_names() -> None:
    assert frequency_in("Spec 11000000.0Hz") == 11e6
    assert frequency_in("Z at 12.5 MHz") == 12.5e6
    assert frequency_in("500kHz") == 500e3
    assert np.isnan(frequency_in("real"))


def test_rows_are_cut_at_gaps_and_turns() -> None:
    there = np.stack([np.arange(10.0), np.zeros(10)], axis=1)
    back = np.stack([np.arange(9.0, -1, -1), np.ones(10)], axis=1)
    far = there + np.array([0, 50])
    row, point = rows_along(np.concatenate([there, back, far]))
    assert row.max() == 2
    assert [int((row == k).sum()) for k in range(3)] == [10, 10, 10]
    assert point[:3].tolist() == [0, 1, 2]


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)), min_size=1, max_size=60))
def test_rows_number_every_reading_once(path: list[tuple[float, float]]) -> None:
    row, point = rows_along(np.array(path))
    assert len({(int(r), int(p)) for r, p in zip(row, point, strict=True)}) == len(path)
    assert row[0] == 0
    assert set(np.diff(row)) <= {0, 1}
    assert all(point[row == k].tolist() == list(range(int((row == k).sum()))) for k in np.unique(row))


@pytest.mark.skipif(not (DATA / "ect_cscan_brisect").is_dir(), reason="the real scan is not beside this checkout")
def test_a_real_scan_loads_and_tells_plate_from_air() -> None:
    path = DATA / "ect_cscan_brisect" / "CoarseScanMultiFreq.csv"
    assert len(csv_channels(path)) == 3
    record = read_record_csv(path, channel="Spec 13000000.0Hz")
    assert len(record) == 3623
    assert (record.frequency_hz == 13e6).all()
    assert record.part_mm[:, 0].min() == pytest.approx(78.5, abs=0.1)
    assert record.part_mm[:, 1].max() == pytest.approx(97.5, abs=0.1)
    assert 8 <= record.row.max() + 1 <= 60
    # Two clouds of readings, metal and air, far apart against the spread within one.
    z = record.impedance_ohm
    far = z[np.abs(z - z[0]).argmax()]
    near_first = np.abs(z - z[0]) < np.abs(z - far)
    apart = abs(z[near_first].mean() - z[~near_first].mean())
    assert 0.05 < near_first.mean() < 0.95
    assert apart > 4 * max(z[near_first].std(), z[~near_first].std())


@pytest.mark.skipif(
    not (DATA / "ect_lissajous_fernandes").is_dir(), reason="the real traces are not beside this checkout"
)
def test_a_real_trace_without_positions_loads() -> None:
    path = DATA / "ect_lissajous_fernandes" / "var_peq_10.csv"
    record = read_record_csv(path, columns=("time_s", "real", "imag"))
    assert len(record) == 1279
    size = np.abs(record.impedance_ohm - record.impedance_ohm[0])
    assert np.ptp(record.time_s) == pytest.approx(4.99, abs=0.01)
    assert size.max() > 1.0
