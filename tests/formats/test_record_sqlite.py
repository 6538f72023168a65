"""The record survives what happens in a laboratory: a crash, a wrong file, a second writer."""

from __future__ import annotations

import math
import os
import signal
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.errors import EddyscanError, FileError, WorkError
from eddyscan.core.record import OVERLOAD, Reading
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import RecordSink
from eddyscan.formats import record_sqlite
from eddyscan.formats.records import SqliteRecord, read_record, record_passes


def reading(row: int, point: int, **changes: object) -> Reading:
    values: dict[str, object] = {
        "row": row,
        "point": point,
        "time_s": 0.1 * point + row,
        "stage_mm": (1.0 + point, 2.0 + row, 3.0),
        "frequency_hz": 5e5,
        "impedance_ohm": complex(1.25 + point, 40.5 - row),
        "flag": 0,
        "target_mm": (1.001 + point, 2.002 + row, 3.003),
    }
    return Reading(**{**values, **changes})  # type: ignore[arg-type]


def a_record(path: Path, readings: int = 3) -> Path:
    with SqliteRecord(path) as record:
        record.note("T_stage_part", np.eye(4))
        for point in range(readings):
            record.write([reading(0, point)])
    return path


def test_keeps_the_promises_of_a_sink(tmp_path: Path) -> None:
    with SqliteRecord(tmp_path / "r.sqlite") as record:
        assert isinstance(record, RecordSink)


def test_is_set_to_wal_and_full(tmp_path: Path) -> None:
    with SqliteRecord(tmp_path / "r.sqlite") as record:
        assert record._db.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
        assert record._db.execute("PRAGMA synchronous").fetchone()[0] == 2


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.tuples(
            st.floats(allow_nan=False),
            st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3),
            st.complex_numbers(allow_nan=True, allow_infinity=True),
            st.integers(0, 7),
        ),
        min_size=1,
        max_size=8,
    )
)
def test_every_number_comes_back_bit_for_bit(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple]) -> None:
    path = tmp_path_factory.mktemp("exact") / "r.sqlite"
    given_readings = [
        reading(0, k, time_s=t, stage_mm=mm, impedance_ohm=z, flag=flag) for k, (t, mm, z, flag) in enumerate(rows)
    ]
    with SqliteRecord(path) as sink:
        sink.note("T_stage_part", np.eye(4).tolist())
        sink.write(given_readings)
    record = read_record(path)
    np.testing.assert_array_equal(record.time_s, [r.time_s for r in given_readings])
    np.testing.assert_array_equal(record.stage_mm, [r.stage_mm for r in given_readings])
    np.testing.assert_array_equal(record.impedance_ohm.real, [r.impedance_ohm.real for r in given_readings])
    np.testing.assert_array_equal(record.impedance_ohm.imag, [r.impedance_ohm.imag for r in given_readings])
    np.testing.assert_array_equal(record.flag, [r.flag for r in given_readings])


def test_an_overload_without_value_is_kept_as_nan(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    with SqliteRecord(path) as sink:
        sink.note("T_stage_part", np.eye(4))
        sink.write([reading(0, 0, impedance_ohm=complex(math.nan, math.nan), flag=OVERLOAD)])
    record = read_record(path)
    assert np.isnan(record.impedance_ohm[0])
    assert record.flag[0] == OVERLOAD


def test_notes_of_every_kind_come_back(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    with SqliteRecord(path) as sink:
        sink.note("settings", Technique())
        sink.note("air", 3 + 4j)
        sink.note("hashes", {"surface.ply": "ab12"})
        sink.note("speed", 1)
        sink.note("speed", 2)
        sink.note("event", {"what": "lift"})
        sink.note("event", {"what": "go on"})
        sink.note("reference", {"notch_mm": 0.5})
        sink.note("T_stage_part", np.eye(4))
        assert sink.meta()["speed"] == 2
    meta = read_record(path).meta
    assert Technique.model_validate(meta["settings"]) == Technique()
    assert meta["air"] == {"re": 3.0, "im": 4.0}
    assert meta["hashes"] == {"surface.ply": "ab12"}
    assert [event["what"] for event in meta["events"]] == ["lift", "go on"]
    assert meta["references"] == [{"notch_mm": 0.5}]


def test_a_note_that_is_no_json_names_its_kind(tmp_path: Path) -> None:
    with (
        SqliteRecord(tmp_path / "r.sqlite") as sink,
        pytest.raises(TypeError, match="a record note cannot hold a lock"),
    ):
        sink.note("lock", __import__("threading").Lock())


def test_nothing_is_doubled_and_a_refused_batch_leaves_no_trace(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    with SqliteRecord(path) as sink:
        with pytest.raises(WorkError, match=r"already holds .* row 0 point 9 to row 0 point 1 .* never replaced"):
            sink.write([reading(0, 9), reading(0, 1)])
        assert sink.done() == {(0, 0), (0, 1), (0, 2)}


def test_reopening_goes_on(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    with SqliteRecord(path) as sink:
        assert sink.done() == {(0, 0), (0, 1), (0, 2)}
        assert sink.meta()["T_stage_part"] == np.eye(4).tolist()
        sink.write([reading(1, 0)])
    assert list(read_record(path).row) == [0, 0, 0, 1]


def test_passes_are_kept_apart(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    with SqliteRecord(path, scan_pass=1) as fine:
        assert fine.done() == set()
        fine.write([reading(0, 0, frequency_hz=1e6)])
    assert record_passes(path) == (0, 1)
    assert list(read_record(path).frequency_hz) == [1e6]
    assert len(read_record(path, scan_pass=0)) == 3
    with pytest.raises(FileError, match=r"holds no pass 7; it holds 0, 1"):
        read_record(path, scan_pass=7)


def test_closing_twice_is_fine_and_leaves_one_file(tmp_path: Path) -> None:
    sink = SqliteRecord(tmp_path / "r.sqlite")
    sink.write([reading(0, 0)])
    sink.close()
    sink.close()
    assert [p.name for p in tmp_path.iterdir()] == ["r.sqlite"]


def test_reading_a_finished_record_leaves_nothing_beside_it(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    before = path.read_bytes()
    read_record(path)
    record_passes(path)
    assert [p.name for p in tmp_path.iterdir()] == ["r.sqlite"]
    assert path.read_bytes() == before


def test_a_record_in_a_folder_without_write_permission_is_read(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    tmp_path.chmod(0o555)
    try:
        assert len(read_record(path)) == 3
    finally:
        tmp_path.chmod(0o755)


def test_can_be_read_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    with SqliteRecord(path) as sink:
        sink.note("T_stage_part", np.eye(4))
        for point in range(3):
            sink.write([reading(0, point)])
            assert len(read_record(path)) == point + 1


WRITER = """
import sys
from eddyscan.core.record import Reading
from eddyscan.formats.records import SqliteRecord
sink = SqliteRecord(sys.argv[1])
sink.note("T_stage_part", [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]])
done = sink.done()
for point in range(100000):
    if (0, point) not in done:
        sink.write([Reading(0, point, 0.0, (float(point), 0.0, 0.0), 5e5, 1j, 0, (0.0, 0.0, 0.0))])
        print(point, flush=True)
"""


def run_until_killed(path: Path, readings: int) -> int:
    """Start a writer in its own process, kill -9 it after `readings`, return the last point it called durable."""
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert writer.stdout is not None
    for _ in range(readings):
        writer.stdout.readline()
    os.kill(writer.pid, signal.SIGKILL)
    told = writer.stdout.read().split()
    writer.stdout.close()
    writer.wait(timeout=30)
    return int(told[-1]) if told else -1


def test_survives_kill_9_twice_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    first = run_until_killed(path, 20)
    record = read_record(path)
    assert len(record) >= max(first + 1, 20)
    assert list(record.point) == list(range(len(record)))
    run_until_killed(path, 20)
    again = read_record(path)
    assert len(again) >= len(record) + 20
    assert list(again.point) == list(range(len(again)))
    np.testing.assert_array_equal(again.stage_mm[:, 0], again.point)


def test_a_copy_of_file_and_log_without_the_shared_memory_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    run_until_killed(path, 10)
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("r.sqlite", "r.sqlite-wal"):
        (moved / name).write_bytes((tmp_path / name).read_bytes())
    assert len(read_record(moved / "r.sqlite")) == len(read_record(path))


def test_a_torn_log_loses_at_most_its_end(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    run_until_killed(path, 30)
    log = tmp_path / "r.sqlite-wal"
    log.write_bytes(log.read_bytes()[:-1000])
    (tmp_path / "r.sqlite-shm").unlink(missing_ok=True)
    record = read_record(path)
    assert list(record.point) == list(range(len(record)))
    with SqliteRecord(path) as sink:
        assert len(sink.done()) == len(record) >= 28


@pytest.mark.parametrize("keep", [0.02, 0.3, 0.7])
def test_a_truncated_record_says_so(tmp_path: Path, keep: float) -> None:
    path = a_record(tmp_path / "r.sqlite", 2000 // 4)
    data = path.read_bytes()
    path.write_bytes(data[: int(keep * len(data))])
    for opening in (read_record, SqliteRecord):
        with pytest.raises(FileError, match=r"r\.sqlite cannot be read .* truncated, damaged .* restore it"):
            opening(path)


def test_an_empty_file_says_so(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    path.touch()
    with pytest.raises(FileError, match=r"is empty \(0 bytes\)"):
        read_record(path)


def test_another_kind_of_file_says_so(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    path.write_bytes(b"\x89PNG" * 2000)
    for opening in (read_record, SqliteRecord):
        with pytest.raises(FileError, match="of another kind"):
            opening(path)


def test_a_foreign_database_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    db = sqlite3.connect(path)
    db.execute("CREATE TABLE music (title TEXT)")
    db.commit()
    db.close()
    before = path.read_bytes()
    for opening in (read_record, SqliteRecord):
        with pytest.raises(FileError, match="another program"):
            opening(path)
    assert path.read_bytes() == before


def test_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = a_record(tmp_path / "r.sqlite")
    db = sqlite3.connect(path)
    db.execute("PRAGMA user_version=9")
    db.close()
    with pytest.raises(FileError, match="version 9, this software reads version 1"):
        read_record(path)


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"there is no record .*none\.sqlite"):
        read_record(tmp_path / "none.sqlite")
    with pytest.raises(FileError, match="folder does not exist"):
        SqliteRecord(tmp_path / "no" / "r.sqlite")


def test_a_file_made_but_never_written_says_so(tmp_path: Path) -> None:
    path = tmp_path / "r.sqlite"
    db = sqlite3.connect(path)
    db.execute("PRAGMA journal_mode=WAL")
    db.close()
    with pytest.raises(FileError, match="stopped before its first one"):
        read_record(path)
    a_record(path)
    assert len(read_record(path)) == 3


def test_a_second_writer_waits_then_says_who_is_in_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_sqlite, "BUSY_S", 0.05)
    path = a_record(tmp_path / "r.sqlite")
    with (
        SqliteRecord(path) as first,
        SqliteRecord(path) as second,
        first._transaction(),
        pytest.raises(FileError, match="held by another program"),
    ):
        second.write([reading(5, 5)])


def test_a_full_disk_stops_with_the_way_out(tmp_path: Path) -> None:
    with SqliteRecord(tmp_path / "r.sqlite") as sink:
        sink.write([reading(0, 0)])
        pages = sink._db.execute("PRAGMA page_count").fetchone()[0]
        sink._db.execute(f"PRAGMA max_page_count={pages}")
        with pytest.raises(EddyscanError, match=r"could not be written.*Free some disk space, then run again"):
            sink.write([reading(1, point) for point in range(5000)])
        assert sink.done() == {(0, 0)}
