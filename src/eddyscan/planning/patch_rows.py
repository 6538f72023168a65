"""Rows on one patch: laid, checked, filled where they leave gaps, laid anew from another seed when that fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.technique import Technique
from eddyscan.planning.gaps import gaps_between, line_through, widest
from eddyscan.planning.levels import Line
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.strategies import RowField, row_fields
from eddyscan.planning.strokes import Stroke, stroke_from_line
from eddyscan.planning.verify import Samples, dense_samples, distance_to_strokes

GOOD_SWEPT = 0.999
GOOD_GAP_OF_PITCH = 0.58
SEEDS_TRIED = 3
FILL_ROUNDS = 2


@dataclass(frozen=True)
class PlannedPatch:
    """A patch, its rows, and how far each dense sample of its region is from them.

    Attributes
    ----------
    surface : SmoothSurface
    strokes : list of Stroke
    samples : Samples
    inside : (N,) bool, samples of the region rows are meant for
    distance_mm : (N,) to the nearest stroke
    """

    surface: SmoothSurface
    strokes: list[Stroke]
    samples: Samples
    inside: BoolArray
    distance_mm: Array

    @property
    def swept(self) -> float:
        """Return the share of the region within half a pitch of a row; unset pitch is the samples' footprint."""
        n = int(self.inside.sum())
        return float((self.distance_mm[self.inside] <= self.samples.reach_mm).sum() / n) if n else 1.0

    @property
    def widest_mm(self) -> float:
        """Return the largest distance [mm] from the region to a row."""
        return widest(self.distance_mm, self.inside)


def planned_patch(surface: SmoothSurface, technique: Technique, guard: Array) -> PlannedPatch | None:
    """Return the best rows found on a patch, or None when the guard (V,) leaves nothing of it."""
    settings = technique.plan
    samples = dense_samples(surface.vertices, surface.faces, surface.normals, settings.pitch_mm)
    best: PlannedPatch | None = None
    for tried, rows in enumerate(row_fields(surface, settings, guard), start=1):
        patch = _laid(surface, technique, samples, rows, guard)
        if best is None or (patch.swept, -patch.widest_mm) > (best.swept, -best.widest_mm):
            best = patch
        good = best.swept >= GOOD_SWEPT and best.widest_mm <= GOOD_GAP_OF_PITCH * settings.pitch_mm
        if good or tried == SEEDS_TRIED:
            break
    return best if best is not None and best.strokes else None


def _laid(surface: SmoothSurface, technique: Technique, samples: Samples, rows: RowField, guard: Array) -> PlannedPatch:
    settings = technique.plan
    strokes = _strokes(surface, rows.rows(settings), settings.step_mm)
    inside = samples.of(guard, surface.faces) > 0
    distance = distance_to_strokes(samples, strokes, settings.pitch_mm / 8)
    if settings.strategy == "geodesic":
        at = samples.of(rows.field[: len(guard)], surface.faces)
        for _ in range(FILL_ROUNDS):
            gaps = gaps_between(samples, np.where(inside, distance, 0.0), at, settings.pitch_mm)
            lines = [line for gap in gaps if (line := line_through(gap, rows.lines_at, settings.step_mm)) is not None]
            extra = _strokes(surface, lines, settings.step_mm)
            if not extra:
                break
            strokes += extra
            distance = np.minimum(distance, distance_to_strokes(samples, extra, settings.pitch_mm / 8))
    return PlannedPatch(surface, strokes, samples, inside, distance)


def _strokes(surface: SmoothSurface, lines: list[Line], step_mm: float) -> list[Stroke]:
    strokes = [stroke_from_line(line, surface, step_mm) for line in lines]
    return [stroke for stroke in strokes if stroke is not None]
