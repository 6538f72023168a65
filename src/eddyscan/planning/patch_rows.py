"""Rows on one patch: laid, checked, filled where they leave gaps, laid anew from another seed when that fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.technique import Technique
from eddyscan.planning.access import Access
from eddyscan.planning.gaps import gaps_between, line_through
from eddyscan.planning.levels import Line
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.strategies import RowField, row_fields
from eddyscan.planning.strokes import Stroke, parts_of, stroke_from_line
from eddyscan.planning.verify import Samples, dense_samples, distance_to_strokes

GOOD_SWEPT = 0.999
GOOD_GAP_OF_PITCH = 0.58
SEEDS_TRIED = 3
FILL_ROUNDS = 2
FINE_OF_PITCH = 1 / 8


@dataclass(frozen=True)
class PlannedPatch:
    """A patch, its rows, and how far each dense sample of its region is from them.

    Attributes
    ----------
    surface : SmoothSurface
    strokes : list of Stroke
    samples : Samples
    inside : (N,) bool, samples of the region rows are meant for
    blocked : (N,) bool, samples that the probe cannot read; not inside
    distance_mm : (N,) to the nearest stroke
    """

    surface: SmoothSurface
    strokes: list[Stroke]
    samples: Samples
    inside: BoolArray
    blocked: BoolArray
    distance_mm: Array

    @property
    def swept(self) -> float:
        """Return the share of the region within half a footprint of a row."""
        n = int(self.inside.sum())
        return float((self.distance_mm[self.inside] <= self.samples.reach_mm).sum() / n) if n else 1.0

    @property
    def widest_mm(self) -> float:
        """Return the largest distance [mm] from the region to a row, 0 when the region is empty."""
        return float(self.distance_mm[self.inside].max()) if self.inside.any() else 0.0


def planned_patch(surface: SmoothSurface, technique: Technique, guard: Array, access: Access) -> PlannedPatch | None:
    """Return the best rows found on a patch, or None when the guard (V,) leaves nothing of it."""
    settings = technique.plan
    samples = dense_samples(surface.vertices, surface.faces, surface.normals, settings.pitch_mm)
    best: PlannedPatch | None = None
    for tried, rows in enumerate(row_fields(surface, settings, guard), start=1):
        patch = _Laying(surface, technique, samples, rows, access).laid(guard)
        if best is None or (patch.swept, -patch.widest_mm) > (best.swept, -best.widest_mm):
            best = patch
        good = best.swept >= GOOD_SWEPT and best.widest_mm <= GOOD_GAP_OF_PITCH * settings.pitch_mm
        if good or tried == SEEDS_TRIED:
            break
    return best if best is not None and best.strokes else None


@dataclass(frozen=True)
class _Laying:
    surface: SmoothSurface
    technique: Technique
    samples: Samples
    rows: RowField
    access: Access

    def laid(self, guard: Array) -> PlannedPatch:
        settings = self.technique.plan
        strokes, lost = self._strokes(self.rows.rows(settings))
        inside = self.samples.of(guard, self.surface.faces) > 0
        distance = self._distance(strokes)
        blocked = inside & self._blocked(lost, distance)
        brink = self._near(lost) < settings.pitch_mm
        if settings.strategy == "geodesic":
            at = self.samples.of(self.rows.field[: len(guard)], self.surface.faces)
            for _ in range(FILL_ROUNDS):
                open_to = np.where(inside & ~blocked & ~brink, distance, 0.0)
                gaps = gaps_between(self.samples, open_to, at, settings.pitch_mm)
                found = [line_through(gap, self.rows.lines_at, settings.step_mm) for gap in gaps]
                extra, _ = self._strokes([line for line in found if line is not None])
                if not extra:
                    break
                strokes += extra
                distance = np.minimum(distance, self._distance(extra))
        return PlannedPatch(self.surface, strokes, self.samples, inside & ~blocked, blocked, distance)

    def _distance(self, strokes: list[Stroke]) -> Array:
        return distance_to_strokes(self.samples, strokes, FINE_OF_PITCH * self.technique.plan.pitch_mm)

    def _strokes(self, lines: list[Line]) -> tuple[list[Stroke], Array]:
        """Return the readable parts of the lines' strokes, and the spots (K, 3) the probe cannot read."""
        made = [stroke_from_line(line, self.surface, self.technique.plan) for line in lines]
        strokes = [stroke for stroke in made if stroke is not None]
        if not strokes:
            return [], np.empty((0, 3))
        points, normals = (np.concatenate([getattr(s, name) for s in strokes]) for name in ("points", "normals"))
        free = self.access.free(points, normals)
        if free.all():
            return strokes, np.empty((0, 3))
        cuts = np.cumsum([len(stroke.points) for stroke in strokes])[:-1]
        kept = [part for s, mask in zip(strokes, np.split(free, cuts), strict=True) for part in parts_of(s, mask)]
        read = {tuple(spot) for part in kept for spot in part.points.tolist()}
        lost = np.array([spot for spot in points.tolist() if tuple(spot) not in read]).reshape(-1, 3)
        return kept, lost

    def _blocked(self, lost: Array, distance: Array) -> BoolArray:
        """Return the samples left out because the readings that would cover them cannot be taken."""
        reach = self.technique.plan.pitch_mm + self.technique.plan.step_mm
        return np.asarray((distance > self.samples.reach_mm) & (self._near(lost) < np.minimum(distance, reach)))

    def _near(self, lost: Array) -> Array:
        """Return each sample's distance (N,) to the nearest spot that cannot be read."""
        if len(lost) == 0:
            return np.full(len(self.samples.points), np.inf)
        return np.asarray(KDTree(lost).query(self.samples.points)[0])
