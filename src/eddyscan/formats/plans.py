"""Plans on disk: whole as JSON (exact round trip), as points in CSV, and out to other systems."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import asdict, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.errors import FileError, GeometryError, InputError
from eddyscan.core.plan import KINDS, Coverage, ScanPlan, Uncovered

FORMAT = "eddyscan plan"
VERSION = 1
CSV_HEADER = [
    "row",
    "point",
    "s_mm",
    "x_mm",
    "y_mm",
    "z_mm",
    "nx",
    "ny",
    "nz",
    "tilt_deg",
    "lift_off_mm",
    "speed_mm_s",
    "kind",
]
INTEGERS = ("kind", "row", "point")
ARRAYS = (*INTEGERS, "s_mm", "surface_mm", "normal", "T_part_probe", "tilt_deg", "lift_off_mm", "speed_mm_s", "time_s")

# Format name -> module and function `write(plan, path)`.
EXPORTS = {
    "gcode": "eddyscan.formats.plan_gcode",
    "noether": "eddyscan.formats.plan_noether",
    "ros": "eddyscan.formats.plan_ros",
    "urscript": "eddyscan.formats.plan_urscript",
    "krl": "eddyscan.formats.plan_krl",
}
FORMATS = ("json", "csv", *EXPORTS)


def write_plan(plan: ScanPlan, path: Path) -> Path:
    """Write a plan as `.json` (whole) or `.csv` (one line per point) and return the path.

    Raises
    ------
    InputError
        When the name ends otherwise.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv":
        _write_csv(plan, path)
    elif path.suffix.lower() == ".json":
        _write_json(plan, path)
    else:
        raise InputError(f"{path.name}: a plan is written as .json or .csv; for other systems use export --format.")
    return path


def read_plan(path: Path) -> ScanPlan:
    """Read a plan that `write_plan` wrote as `.json`.

    Raises
    ------
    FileError
        When the file is missing, damaged, of another kind or of a newer version.
    """
    path = Path(path)
    data = _loaded(path)
    try:
        arrays: dict[str, Any] = {
            name: np.asarray(data[name], dtype=np.int64 if name in INTEGERS else np.float64) for name in ARRAYS
        }
        last_row = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(arrays["kind"]), 1, 4))
        arrays["T_part_probe"] = np.concatenate([arrays["T_part_probe"].reshape(-1, 3, 4), last_row], axis=1)
        for name in ("surface_mm", "normal"):
            arrays[name] = arrays[name].reshape(-1, 3)
        return ScanPlan(
            **arrays,
            coverage=_coverage(data["coverage"]),
            settings=data["settings"],
            inputs=data["inputs"],
            notes=tuple(data["notes"]),
        )
    except (KeyError, TypeError, ValueError, GeometryError) as error:
        raise FileError(f"{path} is damaged: {error}. Plan again.") from error


def export_plan(plan: ScanPlan, format_name: str, path: Path) -> Path:
    """Write a plan for another system and return the path.

    Raises
    ------
    InputError
        When the format is unknown.
    """
    path = Path(path)
    if format_name == "json":
        _write_json(plan, path)
    elif format_name == "csv":
        _write_csv(plan, path)
    elif format_name in EXPORTS:
        write: Callable[[ScanPlan, Path], None] = import_module(EXPORTS[format_name]).write
        write(plan, path)
    else:
        raise InputError(f"there is no plan format {format_name!r}; known are {', '.join(FORMATS)}.")
    return path


def _loaded(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileError(f"{path} does not exist. Make the plan first: eddyscan plan.") from None
    except (json.JSONDecodeError, UnicodeDecodeError, OSError) as error:
        raise FileError(f"{path} is not a readable JSON file: {error}. Plan again.") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FileError(f"{path} is not a scan plan: it lacks 'format': {FORMAT!r}. Give a plan.json of eddyscan plan.")
    if data.get("version") != VERSION:
        raise FileError(
            f"{path} is a plan of version {data.get('version')}, this eddyscan reads version {VERSION}. Plan again."
        )
    return data


def _coverage(data: dict[str, Any]) -> Coverage:
    known = {field.name for field in fields(Coverage)}
    values: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in data.items() if name in known}
    values["uncovered"] = tuple(
        Uncovered(u["reason"], u["area_mm2"], None if u["centre_mm"] is None else tuple(u["centre_mm"]))
        for u in data["uncovered"]
    )
    return Coverage(**values)


def _write_json(plan: ScanPlan, path: Path) -> None:
    data: dict[str, Any] = {"format": FORMAT, "version": VERSION, "units": "mm, deg, s", "frame": "part"}
    data |= {name: getattr(plan, name).tolist() for name in ARRAYS if name != "T_part_probe"}
    data["T_part_probe"] = plan.T_part_probe[:, :3, :].reshape(-1, 12).tolist()
    data |= {"coverage": asdict(plan.coverage), "settings": plan.settings, "inputs": plan.inputs}
    data["notes"] = list(plan.notes)
    path.write_text(json.dumps(data), encoding="utf-8")


def _write_csv(plan: ScanPlan, path: Path) -> None:
    columns = [plan.s_mm, *plan.surface_mm.T, *plan.normal.T, plan.tilt_deg, plan.lift_off_mm, plan.speed_mm_s]
    numbers = np.round(np.stack(columns, axis=1), 6) + 0.0
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV_HEADER)
        for row, point, values, kind in zip(plan.row, plan.point, numbers.tolist(), plan.kind, strict=True):
            writer.writerow([int(row), int(point), *values, KINDS[kind]])
