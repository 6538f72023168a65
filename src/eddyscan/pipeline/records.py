"""Records on their way to other systems."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.record import ScanRecord
from eddyscan.inspection import Inspection


def export_inspection(folder: Path, format_name: str, out: Path) -> dict[str, Any]:
    """Write the record of an inspection folder, with lift-off and C-scan when it has been analysed."""
    from eddyscan.formats.record_ply import read_cscan_ply
    from eddyscan.formats.records import read_record

    inspection = Inspection.open(folder)
    record = read_record(inspection.file("record", "record.sqlite"))
    lift_off_mm, cscan = _lift_off(inspection), inspection.file("cscan", "cscan.ply")
    if lift_off_mm is None or len(lift_off_mm) != len(record):
        return _export(record, format_name, out)
    return _export(record, format_name, out, lift_off_mm=lift_off_mm, cscan=read_cscan_ply(cscan))


def export_record_file(source: Path, format_name: str, out: Path) -> dict[str, Any]:
    """Write a record file (.sqlite, .nde, or .csv made here or elsewhere) in another format."""
    from eddyscan.formats.record_nde import read_nde
    from eddyscan.formats.records import read_record, read_record_csv

    readers = {".csv": read_record_csv, ".nde": read_nde}
    return _export(readers.get(source.suffix.lower(), read_record)(source), format_name, out)


def _export(record: ScanRecord, format_name: str, out: Path, **extras: Any) -> dict[str, Any]:
    from eddyscan.formats.records import export_record

    written = export_record(record, format_name, out, **extras)
    return {"format": format_name, "entries": len(record), "file": str(written)}


def _lift_off(inspection: Inspection) -> Array | None:
    path = inspection.file("cscan", "readings.npz")
    if not path.is_file():
        return None
    with np.load(path) as arrays:
        return np.asarray(arrays["lift_off_mm"])
