"""The first thing a reader sees: the verdict in one sentence and the few numbers behind it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from eddyscan.report.content import ReportContent
from eddyscan.report.figures_coverage import examined_share, share_texts
from eddyscan.report.words import MISSING, percent


@dataclass(frozen=True)
class Tile:
    """One number with its name and a word of context."""

    name: str
    value: str
    context: str


@dataclass(frozen=True)
class Headline:
    """Verdict and tiles."""

    verdict: str
    kind: Literal["missing", "warning", "good"]
    tiles: tuple[Tile, ...]


def headline(content: ReportContent) -> Headline:
    """Return the verdict and the tiles of an inspection, whole or partial."""
    verdict, kind = _verdict(content)
    tiles = (_indications(content), _planned(content), _examined(content), _lift_off(content), _readings(content))
    return Headline(verdict, kind, tiles)


def _verdict(content: ReportContent) -> tuple[str, Literal["missing", "warning", "good"]]:
    if content.record is None:
        return "Not inspected yet: this report holds no scan.", "missing"
    if content.indications is None:
        return "Scanned, not analysed yet.", "missing"
    count = len(content.indications)
    if count:
        noun = "indication" if count == 1 else "indications"
        return f"{count} {noun} above the call level, for a qualified person to classify.", "warning"
    if gap_between_readings_mm(content) is not None:
        return "No indication above the call level; readings stand too far apart to exclude short flaws.", "missing"
    return "No indication above the call level in the examined area.", "good"


def gap_between_readings_mm(content: ReportContent) -> float | None:
    """Return the wider of pitch and step [mm] when it exceeds the coil, so a flaw may lie between; else None."""
    widest = max(content.technique.plan.pitch_mm, content.technique.plan.step_mm)
    return widest if widest > 2 * content.technique.probe.outer_radius_mm else None


def _indications(content: ReportContent) -> Tile:
    if content.indications is None:
        return Tile("indications", MISSING, "not analysed")
    level = content.technique.analysis.threshold_mad
    return Tile("indications", str(len(content.indications)), f"call level {level:g} × robust noise")


def _planned(content: ReportContent) -> Tile:
    if content.plan is None:
        return Tile("planned coverage", MISSING, "no plan")
    least = content.technique.plan.coverage_min
    return Tile("planned coverage", percent(content.plan.coverage.swept), f"least allowed {percent(least)}")


def _examined(content: ReportContent) -> Tile:
    if content.cscan is None:
        return Tile("examined surface", MISSING, "no C-scan")
    return Tile(
        "examined surface", share_texts(examined_share(content.cscan))[0], "of the whole surface, edges included"
    )


def _lift_off(content: ReportContent) -> Tile:
    target = content.technique.scan.lift_off_mm
    if content.lift_off_mm is None or not np.isfinite(content.lift_off_mm).any():
        return Tile("lift-off, rms off target", MISSING, f"target {target:g} mm")
    off = content.lift_off_mm[np.isfinite(content.lift_off_mm)] - target
    return Tile("lift-off, rms off target", f"{1000 * np.sqrt(np.mean(off**2)):.0f} µm", f"target {target:g} mm")


def _readings(content: ReportContent) -> Tile:
    if content.record is None:
        return Tile("readings", MISSING, "no scan")
    planned = "" if content.plan is None else f"of {content.plan.n_scan} planned"
    return Tile("readings", str(len(content.record)), planned or "no plan to compare with")
