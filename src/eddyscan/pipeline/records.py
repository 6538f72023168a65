"""Records on their way to other systems."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.inspection import Inspection


def export_inspection(folder: Path, format_name: str, out: Path) -> dict[str, Any]:
    """Write the record of an inspection folder; lift-off comes from its analysis when that is up to date."""
    inspection = Inspection.open(folder)
    record_file = inspection.file("record", "record.sqlite")
    return export_record_file(record_file, format_name, out, _lift_off(inspection))


def export_record_file(source: Path, format_name: str, out: Path, lift_off_mm: Array | None = None) -> dict[str, Any]:
    """Write a record file in another format."""
    from eddyscan.formats.records import export_record, read_record

    record = read_record(source)
    if lift_off_mm is not None and len(lift_off_mm) != len(record):
        lift_off_mm = None
    written = export_record(record, format_name, out, lift_off_mm=lift_off_mm)
    return {"format": format_name, "entries": len(record), "file": str(written)}


def _lift_off(inspection: Inspection) -> Array | None:
    path = inspection.file("cscan", "readings.npz")
    if not path.is_file():
        return None
    with np.load(path) as arrays:
        return np.asarray(arrays["lift_off_mm"])
