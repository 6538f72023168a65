"""Records: the durable file of a scan, its value, and its way to other systems.

`SqliteRecord` is where a scan writes, `read_record` gives the whole record as a
value, `export_record` writes it for others.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.errors import FileError, GeometryError, InputError
from eddyscan.core.frames import Array
from eddyscan.core.record import ScanRecord
from eddyscan.formats.record_csv import write_record_csv
from eddyscan.formats.record_csv_import import read_record_csv
from eddyscan.formats.record_hdf5 import write_hdf5
from eddyscan.formats.record_nde import write_nde
from eddyscan.formats.record_ply import write_cscan_ply, write_record_ply
from eddyscan.formats.record_sqlite import COLUMNS, SqliteRecord, check_kind, explained, is_blank, read_notes

__all__ = ["RECORD_FORMATS", "SqliteRecord", "export_record", "read_record", "read_record_csv", "record_passes"]

RECORD_FORMATS = ("csv", "nde", "hdf5", "ply")


def _open(path: Path) -> sqlite3.Connection:
    if not path.is_file():
        raise FileError(f"there is no record {path}. Scan first, or check the path.")
    if path.stat().st_size == 0 and not path.with_name(path.name + "-wal").exists():
        raise FileError(f"{path} is empty (0 bytes), so it holds no scan. Scan again, or restore it from a copy.")
    # Without a log nobody writes: opened as immutable, SQLite leaves no files of its own beside a finished record.
    finished = "" if path.with_name(path.name + "-wal").exists() else "&immutable=1"
    db = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro{finished}", uri=True, isolation_level=None)
    try:
        with explained(path):
            if is_blank(db):
                raise FileError(f"{path} holds no reading yet: the scan stopped before its first one. Scan again.")
            check_kind(db, path)
    except BaseException:
        db.close()
        raise
    return db


def record_passes(path: Path | str) -> tuple[int, ...]:
    """Return the numbers of the passes that hold readings, in order."""
    path = Path(path)
    with explained(path), closing(_open(path)) as db:
        return tuple(int(number) for (number,) in db.execute("SELECT DISTINCT pass FROM readings ORDER BY pass"))


def read_record(path: Path | str, *, scan_pass: int | None = None) -> ScanRecord:
    """Read a record file, also while a scan is writing it or after it was killed.

    Parameters
    ----------
    path : the SQLite file
    scan_pass : which pass over the part; None takes the last one that holds readings

    Returns
    -------
    ScanRecord
        In the order taken; NaN where the instrument gave no value. `meta` holds
        the last note of every key, "events" and "references" as lists,
        "pass" and "passes".

    Raises
    ------
    FileError
        When there is no such file or pass, or it is empty, truncated or of another kind.
    """
    path = Path(path)
    passes = record_passes(path)
    chosen = (passes[-1] if passes else 0) if scan_pass is None else scan_pass
    if scan_pass is not None and scan_pass not in passes:
        raise FileError(f"{path} holds no pass {scan_pass}; it holds {', '.join(map(str, passes)) or 'no reading'}.")
    with explained(path), closing(_open(path)) as db:
        rows = db.execute(f"SELECT {', '.join(COLUMNS)} FROM readings WHERE pass = ? ORDER BY reading", (chosen,))
        table = np.array(rows.fetchall(), dtype=np.float64).reshape(-1, len(COLUMNS))
        meta = read_notes(db)
    meta |= {"pass": chosen, "passes": list(passes)}
    impedance_ohm = np.empty(len(table), dtype=np.complex128)
    impedance_ohm.real, impedance_ohm.imag = table[:, 10], table[:, 11]
    column = {name: table[:, k] for k, name in enumerate(COLUMNS)}
    return ScanRecord(
        row=column["row"].astype(np.int64),
        point=column["point"].astype(np.int64),
        time_s=column["time_s"],
        stage_mm=table[:, 3:6],
        target_mm=table[:, 6:9],
        frequency_hz=column["frequency_hz"],
        impedance_ohm=impedance_ohm,
        flag=column["flag"].astype(np.int64),
        meta=meta,
    )


def export_record(
    record: ScanRecord,
    format_name: str,
    path: Path | str,
    *,
    lift_off_mm: Array | None = None,
    cscan: CScan | None = None,
) -> Path:
    """Write a record for other systems and return the file's path.

    Parameters
    ----------
    format_name : one of `RECORD_FORMATS`
        csv: one line per reading; nde: Evident .nde 4.3; hdf5: the archive with
        units and frames; ply: the C-scan on the surface, or without one the coil
        positions as points.
    lift_off_mm : (N,) [mm] lift-off of each reading as analysed; None leaves it out
    cscan : goes into hdf5 and ply
    """
    path = Path(path)
    if lift_off_mm is not None and len(lift_off_mm) != len(record):
        raise GeometryError(f"{len(lift_off_mm)} lift-off values for {len(record)} readings. Analyse this very record.")
    if format_name == "csv":
        write_record_csv(record, path, lift_off_mm=lift_off_mm)
    elif format_name == "nde":
        write_nde(record, path, lift_off_mm=lift_off_mm)
    elif format_name == "hdf5":
        write_hdf5(record, path, lift_off_mm=lift_off_mm, cscan=cscan)
    elif format_name == "ply" and cscan is not None:
        write_cscan_ply(cscan, path)
    elif format_name == "ply":
        write_record_ply(record, path, lift_off_mm=lift_off_mm)
    else:
        raise InputError(f"a record cannot be written as {format_name!r}; known are {', '.join(RECORD_FORMATS)}.")
    return path
