"""The record on disk: a SQLite file that grows with every reading and survives a crash.

WAL with ``synchronous=FULL``: a commit returns after the log is on the disk, and
a torn last commit is dropped when the file is opened again (sqlite.org/wal.html,
sqlite.org/pragma.html#pragma_synchronous). Nothing is ever updated or deleted:
readings are unique by (pass, row, point), notes only pile up and the last counts.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from eddyscan.core.errors import FileError, WorkError
from eddyscan.core.record import Reading
from eddyscan.formats.record_json import to_json

APPLICATION_ID = 0x45445953
SCHEMA_VERSION = 1
BUSY_S = 5.0
LISTS = {"event": "events", "events": "events", "reference": "references", "references": "references"}
COLUMNS = (
    "row",
    "point",
    "time_s",
    "x_stage_mm",
    "y_stage_mm",
    "z_stage_mm",
    "x_target_mm",
    "y_target_mm",
    "z_target_mm",
    "frequency_hz",
    "resistance_ohm",
    "reactance_ohm",
    "flag",
)
TABLES = (
    # SQLite stores NaN as NULL, so the measured columns may be NULL: an overloaded reading has no value.
    "CREATE TABLE readings (reading INTEGER PRIMARY KEY AUTOINCREMENT, pass INTEGER NOT NULL, "
    "row INTEGER NOT NULL, point INTEGER NOT NULL, time_s REAL NOT NULL, "
    "x_stage_mm REAL, y_stage_mm REAL, z_stage_mm REAL, x_target_mm REAL, y_target_mm REAL, z_target_mm REAL, "
    "frequency_hz REAL NOT NULL, resistance_ohm REAL, reactance_ohm REAL, flag INTEGER NOT NULL, "
    "UNIQUE (pass, row, point))",
    "CREATE TABLE notes (note INTEGER PRIMARY KEY AUTOINCREMENT, pass INTEGER NOT NULL, key TEXT NOT NULL, "
    "value TEXT NOT NULL)",
)
INSERT = f"INSERT INTO readings (pass, {', '.join(COLUMNS)}) VALUES ({', '.join('?' * (len(COLUMNS) + 1))})"


class SqliteRecord:
    """A `RecordSink` on one SQLite file; opening an existing file goes on with it.

    Parameters
    ----------
    path : file to make or to go on with
    scan_pass : number of the pass over the part, 0 for the first; (pass, row, point) is unique

    Raises
    ------
    FileError
        When the file is damaged, of another kind, or held by another program.
    """

    def __init__(self, path: Path | str, *, scan_pass: int = 0) -> None:
        self.path = Path(path)
        self.scan_pass = scan_pass
        self._lock = threading.RLock()
        if not self.path.parent.is_dir():
            raise FileError(f"cannot make the record {self.path}: the folder does not exist. Make it first.")
        with explained(self.path):
            self._db = sqlite3.connect(self.path, timeout=BUSY_S, isolation_level=None, check_same_thread=False)
            try:
                self._prepare()
            except BaseException:
                self._db.close()
                raise

    def _prepare(self) -> None:
        if not is_blank(self._db):  # before the first write: a foreign file stays as it is
            check_kind(self._db, self.path)
        self._db.execute("PRAGMA journal_mode=WAL")
        self._db.execute("PRAGMA synchronous=FULL")
        with self._transaction():
            if is_blank(self._db):
                for table in TABLES:
                    self._db.execute(table)
                self._db.execute(f"PRAGMA application_id={APPLICATION_ID}")
                self._db.execute(f"PRAGMA user_version={SCHEMA_VERSION}")

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                if self._db.in_transaction:  # a full disk has rolled back already
                    self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")

    def write(self, readings: Sequence[Reading]) -> None:
        """Store readings; all of them are on the disk when this returns, or none.

        Raises
        ------
        WorkError
            When a (row, point) is already recorded, or the disk is full.
        """
        rows = [self._values(reading) for reading in readings]
        try:
            with explained(self.path), self._transaction():
                self._db.executemany(INSERT, rows)
        except sqlite3.IntegrityError as fault:
            raise WorkError(
                f"{self.path.name} already holds one of the {len(rows)} readings from row {readings[0].row} point "
                f"{readings[0].point} to row {readings[-1].row} point {readings[-1].point} in pass {self.scan_pass}; "
                "a reading is never replaced. Skip what done() lists, or scan into a new record."
            ) from fault

    def _values(self, reading: Reading) -> tuple[float | int, ...]:
        z = reading.impedance_ohm
        return (
            self.scan_pass,
            int(reading.row),
            int(reading.point),
            float(reading.time_s),
            *(float(v) for v in reading.stage_mm),
            *(float(v) for v in reading.target_mm),
            float(reading.frequency_hz),
            float(z.real),
            float(z.imag),
            int(reading.flag),
        )

    def done(self) -> set[tuple[int, int]]:
        """Return the (row, point) pairs of this pass that already have a reading."""
        with self._lock, explained(self.path):
            found = self._db.execute("SELECT row, point FROM readings WHERE pass = ?", (self.scan_pass,))
            return {(int(row), int(point)) for row, point in found}

    def note(self, key: str, value: object) -> None:
        """Store a settings entry; the last one of a key counts, "event" and "reference" pile up as lists."""
        text = to_json(value)
        with explained(self.path), self._transaction():
            self._db.execute("INSERT INTO notes (pass, key, value) VALUES (?, ?, ?)", (self.scan_pass, key, text))

    def meta(self) -> dict[str, Any]:
        """Return the notes as `read_record` gives them, to go on with the same settings."""
        with self._lock, explained(self.path):
            return read_notes(self._db)

    def close(self) -> None:
        """Fold the log into the file and close; safe to call twice."""
        with self._lock, explained(self.path):
            try:
                self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            except sqlite3.ProgrammingError:
                return
            self._db.close()

    def __enter__(self) -> SqliteRecord:
        return self

    def __exit__(self, *fault: object) -> None:
        self.close()


def is_blank(db: sqlite3.Connection) -> bool:
    """Tell whether the file has no table and no owner yet."""
    owner = db.execute("PRAGMA application_id").fetchone()[0]
    tables = db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
    return bool(owner == 0 and tables == 0)


def check_kind(db: sqlite3.Connection, path: Path) -> None:
    """Raise FileError unless the file is an undamaged record of a known version."""
    owner = db.execute("PRAGMA application_id").fetchone()[0]
    version = db.execute("PRAGMA user_version").fetchone()[0]
    if owner != APPLICATION_ID:
        raise FileError(f"{path} is a SQLite file of another program, not a scan record. Check the path.")
    if version != SCHEMA_VERSION:
        raise FileError(
            f"{path} is a record of version {version}, this software reads version {SCHEMA_VERSION}. "
            "Open it with the software that wrote it."
        )
    verdict = db.execute("PRAGMA quick_check(1)").fetchone()[0]
    if verdict != "ok":
        raise sqlite3.DatabaseError(verdict)


def read_notes(db: sqlite3.Connection) -> dict[str, Any]:
    """Return the last value of every key; "event" and "reference" notes become lists in order."""
    notes: dict[str, Any] = {"events": [], "references": []}
    for key, text in db.execute("SELECT key, value FROM notes ORDER BY note"):
        value = json.loads(text)
        if key in LISTS:
            notes[LISTS[key]].extend(value if isinstance(value, list) else [value])
        else:
            notes[key] = value
    return notes


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn SQLite's faults into errors that say what to do."""
    try:
        yield
    except sqlite3.IntegrityError:
        raise
    except sqlite3.OperationalError as fault:
        raise _operational(path, fault) from fault
    except sqlite3.DatabaseError as fault:
        if isinstance(fault, sqlite3.ProgrammingError):
            raise
        raise FileError(
            f"{path} cannot be read as a scan record: {fault}. It is truncated, damaged or of another kind; "
            "restore it from a copy, with its -wal file if there is one."
        ) from fault


def _operational(path: Path, fault: sqlite3.OperationalError) -> FileError | WorkError:
    text = str(fault)
    if "locked" in text:
        return FileError(
            f"{path} is held by another program for more than {BUSY_S:.0f} s. Close the other scan, then run again."
        )
    if "full" in text or "I/O" in text:
        return WorkError(f"{path} could not be written: {text}. Free some disk space, then run again: it goes on.")
    return FileError(f"{path} cannot be opened as a scan record: {text}. Check the path and its permissions.")
