"""Strokes: points at equal arc length along lines on the smooth surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.technique import Plan
from eddyscan.planning.levels import Line
from eddyscan.planning.loops import steps_in_loop
from eddyscan.planning.smooth import SmoothSurface

TRIM_OF_STEP = 0.05
SPACING_OF_STEP = 0.008
# Pieces shorter than this are read once, in their middle.
ONE_POINT_OF_STEP = 0.5
SPECK_OF_STEP = 0.02
SHORTEST_RUN = 3
# How far an adaptive step may shrink or grow.
SHORTEST_OF_STEP, LONGEST_OF_STEP = 0.25, 2.0


@dataclass(frozen=True)
class Stroke:
    """One row, or a piece of one, in running order.

    Attributes
    ----------
    points, normals : (N, 3) where readings are taken [mm], unit outward
    s_mm : (N,) arc length from the first point
    level : float, of the row's field
    closed : bool
        The last reading repeats the first: the sweep has no gap and drift shows.
    """

    points: Array
    normals: Array
    s_mm: Array
    level: float
    closed: bool

    def reversed(self) -> Stroke:
        """Return the stroke run the other way."""
        s = self.s_mm[-1] - self.s_mm[::-1]
        return Stroke(self.points[::-1], self.normals[::-1], s, self.level, self.closed)


def surface_distance(p: Array, q: Array, n_p: Array, n_q: Array) -> Array:
    """Return the distance on the surface between near points from the chord and both normals.

    A circular arc over the chord that turns by the angle between the normals.
    """
    chord = np.linalg.norm(q - p, axis=-1)
    half = 0.5 * np.arccos(np.clip(np.einsum("...k,...k->...", n_p, n_q), -1, 1))
    return np.asarray(chord * np.where(half > 1e-6, half / np.maximum(np.sin(half), 1e-12), 1.0))


def stroke_from_line(line: Line, surface: SmoothSurface, settings: Plan) -> Stroke | None:
    """Return readings along a line, or None when it is a mere speck.

    Steps are equal in arc length on the surface: the remainder is spread, so
    the step becomes length / round(length / step). Up to 5 % of a step is left
    at each end when that brings the steps closer to what was asked. With
    `strategy = "grid"` steps are equal in the plan view; with
    `density = "adaptive"` they shrink where the surface curves along the line
    and grow where it is flat, so that the chord error stays what it was told.
    """
    path, normals = surface.at(line.points, np.concatenate([line.face, line.face[-1:]]))
    length = np.linalg.norm(np.diff(path, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(length)])
    if s[-1] < SPECK_OF_STEP * settings.step_mm:
        return None
    at = _spaced(s, path, normals, settings, closed=line.closed)
    segment = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(length) - 1)
    t = (at - s[segment]) / np.maximum(length[segment], 1e-12)
    flat = line.points[segment] + t[:, None] * (line.points[segment + 1] - line.points[segment])
    points, normals = surface.at(flat, line.face[segment])
    return Stroke(points, normals, at - at[0], line.level, line.closed)


def _spaced(s: Array, path: Array, normals: Array, settings: Plan, *, closed: bool) -> Array:
    """Return the arc lengths of the readings: even in a measure that runs along the line."""
    if settings.strategy == "grid":
        measure = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    elif settings.density == "adaptive":
        measure = _by_curvature(s, normals, settings)
    else:
        return _stations(float(s[-1]), settings.step_mm, closed=closed)
    if measure[-1] < SPECK_OF_STEP * settings.step_mm:
        measure = s
    return np.interp(_stations(float(measure[-1]), settings.step_mm, closed=closed), measure, s)


def _by_curvature(s: Array, normals: Array, settings: Plan) -> Array:
    """Return a measure that runs faster where the line curves: the chord of a step h sags by h^2 k / 8."""
    turn = 2 * np.arcsin(np.clip(np.linalg.norm(np.diff(normals, axis=0), axis=1) / 2, 0, 1))
    reach = np.clip(np.diff(s), 1e-9, None)
    window = max(1, round(settings.step_mm / max(float(np.median(reach)), 1e-9)))
    curvature = uniform_filter1d(turn, window, mode="nearest") / uniform_filter1d(reach, window, mode="nearest")
    wanted = np.sqrt(8 * settings.chord_error_mm / np.maximum(curvature, 1e-9))
    step = np.clip(wanted, SHORTEST_OF_STEP * settings.step_mm, LONGEST_OF_STEP * settings.step_mm)
    return np.concatenate([[0.0], np.cumsum(reach * settings.step_mm / step)])


def _stations(length: float, step: float, *, closed: bool) -> Array:
    if closed:
        return np.linspace(0.0, length, steps_in_loop(length, step) + 1)
    if length < ONE_POINT_OF_STEP * step:
        return np.array([length / 2])
    n = max(1, round(length / step))
    over = length - n * step * (1 + SPACING_OF_STEP)
    trim = float(np.clip(over / 2, 0.0, TRIM_OF_STEP * step))
    return np.linspace(trim, length - trim, n + 1)


def parts_of(stroke: Stroke, keep: BoolArray) -> list[Stroke]:
    """Return the runs of a stroke's readings where the mask (N,) is true; a loop cut once is open."""
    if keep.all():
        return [stroke]
    points, normals, mask = stroke.points, stroke.normals, keep
    if stroke.closed:
        first = -int(np.argmin(mask[:-1]))
        points, normals = np.roll(points[:-1], first, axis=0), np.roll(normals[:-1], first, axis=0)
        mask = np.roll(mask[:-1], first)
    s = np.concatenate([[0.0], np.cumsum(surface_distance(points[:-1], points[1:], normals[:-1], normals[1:]))])
    edge = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    runs = zip(np.flatnonzero(edge == 1), np.flatnonzero(edge == -1), strict=True)
    # At the brink of what can be read the answer flickers: a link to a stray reading costs more than it tells.
    return [
        Stroke(points[a:b], normals[a:b], s[a:b] - s[a], stroke.level, False) for a, b in runs if b - a >= SHORTEST_RUN
    ]
