"""From the points of a row to a timed path that the axes can drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from eddyscan.core.frames import Array
from eddyscan.devices.protocols import Axis, TimedPath
from eddyscan.devices.trapezoid import Motion, move

GRID_S = 0.02
FINE = 16  # samples between two points, for lengths and limits
RESERVE = 0.9  # share of an axis' speed and acceleration that a path may use


@dataclass(frozen=True)
class RowPath:
    """A timed path through the points of a row and when it passes each of them.

    Attributes
    ----------
    path : TimedPath
    passes_s : (M,) time [s] at each point, 0 at the first
    speed_mm_s : speed along the path between the ramps
    """

    path: TimedPath
    passes_s: Array
    speed_mm_s: float


def row_path(points_mm: Array, speed_mm_s: float, axes: Sequence[Axis]) -> RowPath:
    """Lay a smooth curve through points and time it: constant speed, ramps inside the row.

    Parameters
    ----------
    points_mm : (M, n_axes) [mm, stage], M >= 2, no two neighbours equal
    speed_mm_s : speed along the curve; lowered where an axis could not follow
    axes : the stage's axes, for their speeds and accelerations

    Returns
    -------
    RowPath
        The curve is the cubic spline over chord length through all points.
    """
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_mm, axis=0), axis=1))])
    curve = CubicSpline(chord, points_mm, bc_type="natural")
    fine = np.unique(np.concatenate([np.linspace(a, b, FINE) for a, b in pairwise(chord)]))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))])
    speed, ramp = _what_axes_allow(curve, fine, speed_mm_s, axes)
    motion = move(0.0, float(length[-1]), speed=speed, acceleration=ramp)
    n = max(int(np.ceil(motion.duration / GRID_S)), 2)
    times = np.linspace(0.0, motion.duration, n + 1)
    states = np.array([motion.state(float(t)) for t in times])
    where = np.interp(states[:, 0], length, fine)
    tangent = curve(where, 1)
    tangent = tangent / np.linalg.norm(tangent, axis=1, keepdims=True)
    position, velocity = curve(where), tangent * states[:, 1:]
    position[-1], velocity[0], velocity[-1] = points_mm[-1], 0.0, 0.0
    passes = _time_at(motion, np.interp(chord, fine, length))
    return RowPath(TimedPath(times, position, velocity), passes, speed)


def _what_axes_allow(curve: CubicSpline, fine: Array, speed: float, axes: Sequence[Axis]) -> tuple[float, float]:
    """Return (speed, ramp acceleration) along the curve that no axis exceeds.

    With p(s) the curve over its length s, an axis needs the speed |p'| v and at
    most the acceleration |p''| v^2 + |p'| a; half of it is kept for the ramps.
    """
    first, second = curve(fine, 1), curve(fine, 2)
    scale = np.linalg.norm(first, axis=1, keepdims=True)
    slope, bend = np.abs(first / scale).max(axis=0), np.abs(second / scale**2).max(axis=0)
    top = RESERVE * np.array([axis.max_speed for axis in axes])
    strength = RESERVE * np.array([axis.acceleration for axis in axes])
    with np.errstate(divide="ignore"):
        v = min(speed, float((top / slope).min()), float(np.sqrt(0.5 * strength / bend).min()))
        ramp = float(((strength - bend * v * v) / slope).min())
    return v, ramp


def _time_at(motion: Motion, distances: Array) -> Array:
    """Return when a motion from 0 has covered each distance (M,), ends included."""
    times = np.linspace(0.0, motion.duration, 2001)
    covered = np.array([motion.state(float(t))[0] for t in times])
    return np.asarray(np.interp(distances, covered, times))
