"""summary.json: time per step, coverage, lift-off, indications and, in the virtual cell only, truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from eddyscan import __version__
from eddyscan.inspection import Inspection, read_json, write_json
from eddyscan.pipeline.rigs import LazyRig
from eddyscan.pipeline.states import states_of
from eddyscan.pipeline.steps import step_summary
from eddyscan.pipeline.truth import truth_of


def write_summary(inspection: Inspection, rig: LazyRig) -> dict[str, Any]:
    """Collect the steps' figures into DIR/summary.json and return them."""
    technique = inspection.technique()
    states = states_of(inspection)
    surface, plan, cscan = (step_summary(inspection, step) for step in ("surface", "plan", "cscan"))
    indications = inspection.file("cscan", "indications.json")
    report = inspection.file("report", "report.html")
    summary: dict[str, Any] = {
        "software": f"eddyscan {__version__}",
        "part": technique.part.name,
        "steps": {state.name: state.state for state in states},
        "seconds": {state.name: state.seconds for state in states if state.seconds is not None},
        "surface": surface,
        "plan": plan,
        "coverage": plan.get("swept_coverage"),
        "lift_off_mm": cscan.get("lift_off_mm"),
        "statistics": cscan,
        "indications": read_json(indications) if indications.is_file() else [],
        "warnings": [*surface.get("warnings", []), *plan.get("notes", []), *cscan.get("warnings", [])],
        "report": str(report) if report.is_file() else None,
    }
    truth = truth_of(inspection, rig)
    if truth is not None:
        summary["truth"] = truth
    write_json(inspection.folder / "summary.json", summary)
    return summary


def summary_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """Return the rows of the summary table for people."""
    rows = [
        [f"step {name}", _with_time(state, summary["seconds"].get(name))] for name, state in summary["steps"].items()
    ]
    plan = summary["plan"]
    if plan:
        rows.append(["rows, points", f"{plan['rows']}, {plan['points']}"])
        rows.append(["swept coverage", f"{100 * plan['swept_coverage']:.2f} %"])
    lift_off = summary["lift_off_mm"]
    if lift_off:
        rows.append(
            [
                "lift-off read: mean (5 to 95 %)",
                f"{lift_off['mean']:.3f} ({lift_off['p05']:.3f} to {lift_off['p95']:.3f}) mm",
            ]
        )
    rows.append(["indications", str(len(summary["indications"]))])
    rows += _truth_rows(summary.get("truth") or {})
    return rows


def _with_time(state: str, seconds: float | None) -> str:
    return state if seconds is None else f"{state}, {seconds:.1f} s"


def _truth_rows(truth: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for name in ("own", "fit"):
        if deviation := (truth.get("surface") or {}).get(name):
            text = f"mean {deviation['mean_abs_mm']:.3f}, RMSE {deviation['rmse_mm']:.3f} mm"
            rows.append([f"truth: surface error ({name})", text])
    if lift_off := (truth.get("path") or {}).get("lift_off_mm"):
        rows.append(["truth: lift-off along the path", f"{lift_off['mean']:.3f} +- {lift_off['sd']:.3f} mm"])
    if flaws := truth.get("indications"):
        rows.append(
            ["truth: flaws found, false calls", f"{flaws['found']} of {flaws['flaws']}, {flaws['false_calls']}"]
        )
    return rows
