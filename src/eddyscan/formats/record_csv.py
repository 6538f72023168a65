"""Records as CSV text: eddyscan's own table, out and in."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array, transform
from eddyscan.core.record import ScanRecord
from eddyscan.formats.record_atomic import replacing

HEADER = (
    "reading,row,point,time_s,x_mm,y_mm,z_mm,x_stage_mm,y_stage_mm,z_stage_mm,"
    "frequency_hz,resistance_ohm,reactance_ohm,lift_off_mm,flag"
)


def write_record_csv(record: ScanRecord, path: Path, *, lift_off_mm: Array | None = None) -> None:
    """Write one line per reading; numbers read back bit for bit.

    Parameters
    ----------
    record : its positions are written in the part frame (x_mm ...) and as axis readings (x_stage_mm ...)
    lift_off_mm : (N,) [mm] as analysed; None or NaN leaves the cell empty
    """
    n = len(record)
    lift = np.full(n, np.nan) if lift_off_mm is None else np.asarray(lift_off_mm, dtype=np.float64)
    part, stage, z = record.part_mm, record.stage_mm, record.impedance_ohm
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        file.write(HEADER + "\n")
        for k in range(n):
            measured = [record.time_s[k], *part[k], *stage[k], record.frequency_hz[k], z[k].real, z[k].imag, lift[k]]
            cells = ["" if np.isnan(v) else repr(float(v)) for v in measured]
            writer.writerow([k, int(record.row[k]), int(record.point[k]), *cells, int(record.flag[k])])


def read_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return the first line's cells and the others', all of one length.

    Raises
    ------
    FileError
        When the file is missing, empty, no text, or a line has another number of cells.
    """
    if not path.is_file():
        raise FileError(f"there is no file {path}. Check the path.")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as fault:
        raise FileError(f"{path} is not a text file: byte {fault.start} is no UTF-8. Give a CSV file.") from fault
    lines = [line for line in csv.reader(text.splitlines()) if line]
    if len(lines) < 2:
        raise FileError(f"{path} holds {len(lines)} lines; a header and at least one reading are needed.")
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(lines[0]):
            raise FileError(
                f"{path} line {number} has {len(line)} cells, the first line has {len(lines[0])}. "
                "The file is truncated or damaged there; repair that line or export it again."
            )
    return lines[0], lines[1:]


def read_own_csv(path: Path, header: list[str], lines: list[list[str]]) -> ScanRecord:
    """Build the record of a table with eddyscan's header.

    The pose T_stage_part is solved from the two sets of positions; lift-off, when
    there is any, goes to ``meta["lift_off_mm"]``.
    """
    cells = np.array([[_number(cell, path, n) for cell in line] for n, line in enumerate(lines, start=2)])
    column = {name: cells[:, k] for k, name in enumerate(header)}
    part, stage = cells[:, 4:7], cells[:, 7:10]
    impedance = np.empty(len(cells), dtype=np.complex128)
    impedance.real, impedance.imag = column["resistance_ohm"], column["reactance_ohm"]
    meta = {"T_stage_part": rigid_fit(part, stage).tolist(), "source": path.name}
    if np.isfinite(column["lift_off_mm"]).any():
        meta["lift_off_mm"] = column["lift_off_mm"].tolist()
    return ScanRecord(
        row=column["row"].astype(np.int64),
        point=column["point"].astype(np.int64),
        time_s=column["time_s"],
        stage_mm=stage,
        target_mm=np.full_like(stage, np.nan),
        frequency_hz=column["frequency_hz"],
        impedance_ohm=impedance,
        flag=column["flag"].astype(np.int64),
        meta=meta,
    )


def _number(cell: str, path: Path, line: int) -> float:
    try:
        return float(cell) if cell else float("nan")
    except ValueError:
        raise FileError(f"{path} line {line}: {cell!r} is not a number. Repair that cell or export again.") from None


def rigid_fit(points_a: Array, points_b: Array) -> Array:
    """Return the T_b_a (4, 4) that takes (N, 3) points a to b with the least squares (Kabsch 1976)."""
    known = np.isfinite(points_a).all(axis=1) & np.isfinite(points_b).all(axis=1)
    if not known.any():
        return np.eye(4)
    a, b = points_a[known], points_b[known]
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    U, _, Vt = np.linalg.svd((b - mean_b).T @ (a - mean_a))
    rotation = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return transform(rotation, mean_b - rotation @ mean_a)
