"""How long the scan takes on a machine whose axes speed up and brake."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.technique import Scan


@dataclass(frozen=True)
class MotionLimits:
    """What the axes x, y, z can do, and what each stop costs.

    Attributes
    ----------
    speed_mm_s, acceleration_mm_s2 : (3,) per axis
    reading_s : float, instrument time per reading
    command_s : float, link and controller time per commanded move
    """

    speed_mm_s: tuple[float, float, float] = (29.0, 29.0, 24.0)
    acceleration_mm_s2: tuple[float, float, float] = (200.0, 200.0, 200.0)
    reading_s: float = 0.015
    command_s: float = 0.008


def move_times(positions: Array, speed_mm_s: Array, limits: MotionLimits) -> Array:
    """Return the time (N - 1,) [s] of straight moves from rest to rest through positions (N, 3).

    All axes arrive together, so the slowest sets the pace: trapezoid of the path
    speed, limited per axis and by `speed_mm_s` (N,) on the way to each position.
    """
    step = np.abs(np.diff(positions, axis=0))
    length = np.linalg.norm(step, axis=1)
    share = step / np.maximum(length, 1e-12)[:, None]
    with np.errstate(divide="ignore"):
        a = (np.asarray(limits.acceleration_mm_s2) / share).min(axis=1)
    v = _path_speed(positions, speed_mm_s, limits)
    finite = length > 1e-9
    v, a = np.where(finite, v, 1.0), np.where(finite, a, 1.0)
    cruise = length >= v * v / a
    time = np.where(cruise, length / v + v / a, 2 * np.sqrt(length / a))
    return np.asarray(np.where(finite, time, 0.0))


def arrival_times(positions: Array, speed_mm_s: Array, in_row: BoolArray, scan: Scan, limits: MotionLimits) -> Array:
    """Return the time (N,) [s] at which each pose is reached, 0 at the first.

    Parameters
    ----------
    positions : (N, 3) [mm], speed_mm_s : (N,) on the way to each
    in_row : (N,) bool, where readings are taken
    scan : Scan
        Step mode stops, settles and reads at every reading; the others run
        through a row at constant speed between a start and a stop.
    """
    moving = move_times(positions, speed_mm_s, limits) + limits.command_s
    if scan.mode == "step":
        stay = np.where(in_row, scan.settle_s + limits.reading_s, 0.0)
        return np.concatenate([[0.0], np.cumsum(moving + stay[:-1])])
    flying = in_row[1:] & in_row[:-1]
    starts, stops = flying & ~np.append(False, flying[:-1]), flying & ~np.append(flying[1:], False)
    length = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    v = _path_speed(positions, speed_mm_s, limits)
    ramp = 0.5 * v / float(np.min(limits.acceleration_mm_s2)) * (starts.astype(float) + stops.astype(float))
    return np.concatenate([[0.0], np.cumsum(np.where(flying, length / v + ramp, moving))])


def _path_speed(positions: Array, speed_mm_s: Array, limits: MotionLimits) -> Array:
    """Return the speed (N - 1,) [mm/s] along each straight way that no axis exceeds."""
    step = np.abs(np.diff(positions, axis=0))
    share = step / np.maximum(np.linalg.norm(step, axis=1), 1e-12)[:, None]
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum((np.asarray(limits.speed_mm_s) / share).min(axis=1), speed_mm_s[1:]))
