"""The steps of one inspection as the page lists them: state, key figure, what to do next."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

from eddyscan.core.errors import EddyscanError
from eddyscan.inspection import Inspection, StepState, read_json
from eddyscan.web.decisions import decisions

TITLES = {"views": "Views", "surface": "Surface", "plan": "Plan", "align": "Align", "record": "Scan"}
LAST_PASS = "SELECT COUNT(*) FROM readings WHERE pass = (SELECT MAX(pass) FROM readings)"
TITLES |= {"cscan": "Results", "report": "Report"}


def overview(inspection: Inspection) -> dict[str, Any]:
    """Return everything about an inspection that is text: steps, figures, indications, decisions."""
    from eddyscan.pipeline import states

    technique = inspection.technique()
    found = {state.name: state for state in states(inspection.folder)}
    summaries = {step: summary_of(inspection, step) for step in ("surface", "plan", "cscan")}
    return {
        "name": inspection.folder.name,
        "part": technique.part.name,
        "nominal": technique.part.nominal,
        "virtual": is_virtual(inspection),
        "steps": [_step(inspection, name, found, summaries) for name in TITLES],
        "views": [_view_entry(path) for path in inspection.view_files()],
        "crop": None if technique.surface.crop is None else technique.surface.crop.model_dump(mode="json"),
        "lift_off_mm": {"planned": technique.scan.lift_off_mm, "limit": technique.analysis.lift_off_max_mm},
        "frequency_hz": technique.drive.frequency_hz,
        "summaries": summaries,
        "indications": indications(inspection),
        "decisions": decisions(inspection),
    }


def summary_of(inspection: Inspection, step: str) -> dict[str, Any]:
    """Return summary.json of a step, or an empty dict."""
    path = inspection.file(step, "summary.json")
    value = read_json(path) if path.is_file() else {}
    return value if isinstance(value, dict) else {}


def indications(inspection: Inspection) -> list[dict[str, Any]]:
    """Return the called indications, empty before the analysis."""
    path = inspection.file("cscan", "indications.json")
    return list(read_json(path)) if path.is_file() else []


def is_virtual(inspection: Inspection) -> bool:
    """Tell whether the folder's own rig.toml is the virtual cell."""
    import tomllib

    try:
        return "world" in tomllib.loads(inspection.rig_file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return True
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False


def readings_so_far(path: Path) -> int:
    """Return how many readings the last pass of a record holds, without holding up its writer."""
    if not path.is_file():
        return 0
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=1.0)) as db:
            return int(db.execute(LAST_PASS).fetchone()[0])
    except sqlite3.Error:
        return 0


def _step(
    inspection: Inspection, name: str, found: dict[str, StepState], summaries: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    state = _align_state(inspection, found) if name == "align" else found[name]
    try:
        figure = FIGURES[name](inspection, summaries)
    except (KeyError, TypeError, IndexError, EddyscanError) as error:
        figure = f"figures cannot be read: {error}"
    return {
        "name": name,
        "title": TITLES[name],
        "state": state.state,
        "why": state.why,
        "figure": figure if state.state != "missing" else "",
        "seconds": state.seconds,
    }


def _align_state(inspection: Inspection, found: dict[str, StepState]) -> StepState:
    aligned = inspection.file("record", "alignment.json").is_file()
    if not aligned:
        return StepState("align", "missing")
    return StepState("align", "stale" if found["record"].state == "stale" else "done", found["record"].why)


def _views(inspection: Inspection, _: dict[str, dict[str, Any]]) -> str:
    count = len(inspection.view_files())
    return f"{count} view{'s' if count != 1 else ''}"


def _surface(_: Inspection, summaries: dict[str, dict[str, Any]]) -> str:
    summary = summaries["surface"]
    size = " × ".join(f"{value:.0f}" for value in summary["size_mm"][:2])
    rmse = [view["inlier_rmse_mm"] for view in summary["views"] if view["inlier_rmse_mm"] is not None]
    fit = f", views agree to {max(rmse):.3f} mm" if rmse else ""
    return f"{size} mm{fit}"


def _plan(_: Inspection, summaries: dict[str, dict[str, Any]]) -> str:
    summary = summaries["plan"]
    covered = f"{100 * summary['swept_coverage']:.1f} % covered"
    return f"{summary['rows']} rows, {summary['points']} points, {covered}, {in_words(summary['duration_s'])}"


def _align(inspection: Inspection, _: dict[str, dict[str, Any]]) -> str:
    path = inspection.file("record", "alignment.json")
    if not path.is_file():
        return ""
    pose = read_json(path)
    x, y, z = (row[3] for row in pose["T_stage_part"][:3])
    return f"corner at {x:.1f}, {y:.1f}, {z:.1f} mm: {pose.get('how', '')}".rstrip(": ")


def _record(inspection: Inspection, summaries: dict[str, dict[str, Any]]) -> str:
    count = readings_so_far(inspection.file("record", "record.sqlite"))
    planned = summaries["plan"].get("points")
    return f"{count} of {planned} readings" if planned else f"{count} readings"


def _cscan(inspection: Inspection, _: dict[str, dict[str, Any]]) -> str:
    called = indications(inspection)
    decided = {entry["number"] for entry in decisions(inspection) if entry["verdict"] != "comment"}
    open_ones = sum(1 for entry in called if entry["number"] not in decided)
    if not called:
        return "no indication"
    return f"{len(called)} indication{'s' if len(called) != 1 else ''}, {open_ones} to decide"


def _report(inspection: Inspection, _: dict[str, dict[str, Any]]) -> str:
    path = inspection.file("report", "report.html")
    return f"report.html, {path.stat().st_size / 1e6:.1f} MB" if path.is_file() else ""


def _view_entry(path: Path) -> dict[str, Any]:
    return {"name": path.name, "bytes": path.stat().st_size}


def in_words(seconds: float) -> str:
    """Return a duration as people say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


FIGURES = {
    "views": _views,
    "surface": _surface,
    "plan": _plan,
    "align": _align,
    "record": _record,
    "cscan": _cscan,
    "report": _report,
}
