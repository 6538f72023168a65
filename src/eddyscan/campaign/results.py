"""What a campaign says: POD curve, false calls, what matters most; always labelled as simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from eddyscan.analysis.pod import PodCurve, pod_from_hits, pod_from_signals
from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array

LABEL = "simulation: physics and noise as assumed, no hardware"
NOISE = 0.75  # times the call level: noise alone has its highest score of a flaw's readings below this
STRAIGHT = 4.0  # times the call level: log score is straight in log length up to here
OUTCOMES = ("found", "score", "surface_rmse_mm", "lift_off_sd_mm")


def summarise(rows: Sequence[Mapping[str, Any]], out: Path) -> dict[str, Any]:
    """Return the campaign's figures and write its picture beside the rows."""
    summary: dict[str, Any] = {"label": LABEL, "cases": len(rows), "rows": str(out)}
    if not rows:
        return summary
    summary["mean_seconds_per_case"] = float(np.mean([row["seconds"] for row in rows]))
    failed = [row for row in rows if row.get("error")]
    if failed:
        summary["failed"] = [{"case": row["case"], "error": row["error"]} for row in failed]
    good = [row for row in rows if not row.get("error")]
    summary["sensitivity"] = sensitivity(good)
    if good and "flaw_length_mm" in good[0]:
        summary |= _detection(good, out)
    return summary


def _detection(rows: Sequence[Mapping[str, Any]], out: Path) -> dict[str, Any]:
    found = np.array([bool(row["found"]) for row in rows])
    area_cm2 = sum(float(row["field_mm"]) ** 2 for row in rows) / 100
    false_calls = int(sum(row["false_calls"] for row in rows))
    figures: dict[str, Any] = {
        "found_share": float(found.mean()),
        "false_calls": false_calls,
        "false_calls_per_m2": false_calls / area_cm2 * 1e4,
        "assumed": {name: _range(rows, name) for name in ("noise", "lift_off_mm", "lift_off_sd_mm", "pitch_mm")},
    }
    curves = _curves(rows, found, figures)
    if curves:
        from eddyscan.campaign.pod_picture import draw_pod

        draw_pod(_column(rows, "flaw_length_mm"), found, curves, out / "pod.png")
        figures["picture"] = str(out / "pod.png")
    return figures


def _curves(rows: Sequence[Mapping[str, Any]], found: Any, figures: dict[str, Any]) -> list[PodCurve]:
    sizes, score = _column(rows, "flaw_length_mm"), _column(rows, "score")
    threshold = float(rows[0]["threshold"])
    curves: list[PodCurve] = []
    notes: list[str] = []
    fits: dict[str, Callable[[], PodCurve]] = {
        "hit_miss": lambda: pod_from_hits(sizes, found, basis=LABEL),
        "signal": lambda: pod_from_signals(
            sizes, score, threshold=threshold, basis=LABEL, limits=(NOISE * threshold, STRAIGHT * threshold)
        ),
    }
    for name, fit in fits.items():
        try:
            curve = fit()
        except InputError as error:
            notes.append(f"{name}: {error}")
            continue
        curves.append(curve)
        figures[f"pod_{name}"] = {
            "a50_mm": curve.a50_mm,
            "a90_mm": curve.a90_mm,
            "a90_95_mm": curve.a90_95_mm,
            "method": curve.method,
            "basis": curve.basis,
        }
    if notes:
        figures["pod_notes"] = notes
    return curves


def sensitivity(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rank the varied parameters by the size of their rank correlation with the first outcome there is."""
    if len(rows) < 4:
        return []
    outcome = next((name for name in OUTCOMES if rows[0].get(name) is not None), None)
    if outcome is None:
        return []
    target = _column(rows, "score" if outcome == "found" and "score" in rows[0] else outcome)
    ranks = []
    for name, value in rows[0].items():
        if name in (*OUTCOMES, "case", "seed", "seconds") or not isinstance(value, (int, float)):
            continue
        values = _column(rows, name)
        if np.isfinite(values).all() and np.ptp(values) > 0 and _is_input(name):
            ranks.append(
                {"parameter": name, "outcome": outcome, "rank_correlation": float(spearmanr(values, target)[0])}
            )
    return sorted(ranks, key=lambda entry: -abs(entry["rank_correlation"]))


def _is_input(name: str) -> bool:
    from eddyscan.campaign.values import SignalValues

    return name in SignalValues.model_fields or name.startswith(("technique.", "world."))


def _column(rows: Sequence[Mapping[str, Any]], name: str) -> Array:
    return np.array([np.nan if row[name] is None else float(row[name]) for row in rows])


def _range(rows: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    values = _column(rows, name)
    return [float(values.min()), float(values.max())]


def result_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """Return the rows of the table for people."""
    rows = [["cases", str(summary["cases"])]]
    for key, words in (("pod_hit_miss", "POD, hit/miss"), ("pod_signal", "POD, signal")):
        if key in summary:
            rows.append([f"{words}: a90, a90/95", f"{summary[key]['a90_mm']:.3f}, {summary[key]['a90_95_mm']:.3f} mm"])
    if "false_calls" in summary:
        rows.append(["false calls", f"{summary['false_calls']} ({summary['false_calls_per_m2']:.1f} per m2)"])
    rows += [["note", note] for note in summary.get("pod_notes", [])]
    rows += [["failed case", f"{entry['case']}: {entry['error']}"] for entry in summary.get("failed", [])[:10]]
    rows += [
        [f"matters: {entry['parameter']}", f"rank correlation {entry['rank_correlation']:+.2f}"]
        for entry in summary.get("sensitivity", [])[:5]
    ]
    return rows
