"""Where rows may run on a patch, and the account of what is left out and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Outline

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.plan import Uncovered
from eddyscan.planning.heights import HeightMap
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.verify import Samples

HIDDEN_MM = 0.5


@dataclass(frozen=True)
class Guard:
    """One reason to leave a zone out: positive inside, in words for what is negative."""

    reason: str
    value: Array


def combined(guards: list[Guard], n: int) -> Array:
    """Return the least of all guards (V,), at most 1e6."""
    return np.asarray(np.minimum.reduce([np.full(n, 1e6), *(guard.value for guard in guards)]))


def tilt_guard(surface: SmoothSurface, tilt_deg: float) -> Array:
    """Return how far (V,) [deg] each vertex is below the steepest slope a vertical probe can look at."""
    return np.asarray(tilt_deg - np.degrees(np.arccos(np.clip(surface.normals[:, 2], -1, 1))))


def hidden_guard(surface: SmoothSurface, heights: HeightMap) -> Array:
    """Return how far (V,) [mm] each vertex is from being covered by something above it."""
    up = np.clip(surface.normals[:, 2], 0.05, 1.0)
    # Within a cell of the map the surface itself rises by the slope.
    own = HIDDEN_MM + 1.5 * heights.cell_mm * np.sqrt(1 - up**2) / up
    return np.asarray(own - (heights.at(surface.vertices[:, 0], surface.vertices[:, 1]) - surface.vertices[:, 2]))


def drawn_guard(surface: SmoothSurface, outlines: tuple[tuple[tuple[float, float], ...], ...]) -> Array:
    """Return how far (V,) [mm, in the plan view] each vertex is inside the nearest drawn outline."""
    xy = surface.vertices[:, :2]
    best = np.full(len(xy), -np.inf)
    for outline in outlines:
        corners = np.asarray(outline, dtype=np.float64)
        a, d = corners, np.roll(corners, -1, axis=0) - corners
        t = np.einsum("vek,ek->ve", xy[:, None] - a, d) / np.maximum(np.einsum("ek,ek->e", d, d), 1e-12)
        foot = a + np.clip(t, 0, 1)[..., None] * d
        distance = np.linalg.norm(xy[:, None] - foot, axis=2).min(axis=1)
        inside = Outline(corners).contains_points(xy)
        best = np.maximum(best, np.where(inside, distance, -distance))
    return best


def left_out(guards: list[Guard], samples: Samples, surface: SmoothSurface) -> list[Uncovered]:
    """Return the zones the guards take away; each spot counts for the first that does."""
    zones = []
    open_to = np.ones(len(samples.face), dtype=bool)
    for guard in guards:
        lost = open_to & (samples.of(guard.value, surface.faces) <= 0)
        open_to &= ~lost
        if lost.any():
            zones.append(zone_of(guard.reason, samples, lost))
    return zones


def zone_of(reason: str, samples: Samples, which: BoolArray) -> Uncovered:
    """Return the zone that the samples of a mask (N,) make up."""
    centre = samples.points[which].mean(axis=0)
    return Uncovered(reason, float(which.sum()) * samples.area_mm2, tuple(np.round(centre, 3).tolist()))


def merged(zones: list[Uncovered]) -> tuple[Uncovered, ...]:
    """Return one entry per reason with the summed area, at the largest zone's centre."""
    by_reason: dict[str, list[Uncovered]] = {}
    for zone in zones:
        by_reason.setdefault(zone.reason, []).append(zone)
    return tuple(
        Uncovered(reason, sum(z.area_mm2 for z in own), max(own, key=lambda z: z.area_mm2).centre_mm)
        for reason, own in by_reason.items()
    )
