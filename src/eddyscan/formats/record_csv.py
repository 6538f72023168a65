"""Records as CSV text: eddyscan's own table out and in, tables made elsewhere in."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.frames import Array
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
    if lift_off_mm is not None and len(lift_off_mm) != n:
        raise GeometryError(f"{len(lift_off_mm)} lift-off values for {n} readings. Analyse this very record.")
    lift = np.full(n, np.nan) if lift_off_mm is None else np.asarray(lift_off_mm, dtype=np.float64)
    part, stage, z = record.part_mm, record.stage_mm, record.impedance_ohm
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        file.write(HEADER + "\n")
        for k in range(n):
            measured = [record.time_s[k], *part[k], *stage[k], record.frequency_hz[k], z[k].real, z[k].imag, lift[k]]
            cells = ["" if np.isnan(v) else repr(float(v)) for v in measured]
            writer.writerow([k, int(record.row[k]), int(record.point[k]), *cells, int(record.flag[k])])


def read_record_csv(path: Path | str) -> ScanRecord:
    """Read eddyscan's own CSV back; the stage-to-part pose is solved from the two sets of positions."""
    raise FileError(f"{path}: reading CSV records is still to come.")
