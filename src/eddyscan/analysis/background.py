"""What changes slowly is not a crack: drift, conductivity, tilt and curvature taken out of the residual."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from eddyscan.core.frames import Array, IntArray

MAD_TO_SIGMA = 1.4826
SHORTEST_WINDOW = 5


def robust_sigma(values: Array) -> float:
    """Return 1.4826 x the median absolute deviation from the median, NaN left out."""
    finite = values[np.isfinite(values)]
    return float(MAD_TO_SIGMA * np.median(np.abs(finite - np.median(finite)))) if finite.size else float("nan")


def explained(channel: Array, causes: Array, *, rounds: int = 4) -> Array:
    """Return the part of a channel that smooth causes explain, by a robust linear fit.

    Parameters
    ----------
    channel : (M,)
    causes : (M, C)
        Columns such as powers of lift-off, tilt and curvature; a constant is added.
    rounds : int
        Refits with readings beyond 4 robust standard deviations left out, so that a
        crack does not bend the fit.
    """
    finite = np.isfinite(channel) & np.isfinite(causes).all(axis=1)
    spread = causes[finite].std(axis=0)
    used = spread > 1e-12
    design = np.column_stack(
        [np.ones(len(channel)), (causes[:, used] - causes[finite][:, used].mean(axis=0)) / spread[used]]
    )
    keep, fit = finite, np.zeros(design.shape[1])
    for _ in range(rounds):
        fit, *_ = np.linalg.lstsq(design[keep], channel[keep], rcond=None)
        left = channel - design @ fit
        keep = finite & (np.abs(left) < 4.0 * max(robust_sigma(left[finite]), 1e-300))
        if keep.sum() < 2 * design.shape[1]:
            break
    return np.asarray(design @ fit)


def slow_along_rows(channel: Array, row: IntArray, position_mm: Array, *, window_mm: float) -> Array:
    """Return the running median of a channel along each row.

    Parameters
    ----------
    channel : (M,) in the order of reading
    row : (M,) int64
    position_mm : (M, 3)
    window_mm : float [mm]
        Longer than any single indication, so that the median does not follow it.
    """
    slow = np.full(len(channel), np.nan)
    for number in np.unique(row):
        members = np.flatnonzero((row == number) & np.isfinite(channel))
        if members.size:
            slow[members] = _running_median(channel[members], position_mm[members], window_mm)
    return slow


def _running_median(values: Array, position_mm: Array, window_mm: float) -> Array:
    if len(values) < SHORTEST_WINDOW:
        return np.full(len(values), np.median(values))
    step = np.median(np.linalg.norm(np.diff(position_mm, axis=0), axis=1))
    count = int(np.ceil(window_mm / max(step, 1e-9))) | 1
    count = max(SHORTEST_WINDOW, min(count, len(values) - 1 | 1))
    return np.asarray(median_filter(values, size=count, mode="nearest"))
