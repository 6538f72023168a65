"""What changes slowly is not a crack: drift, conductivity, tilt and curvature taken out of the residual."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, BoolArray, IntArray

MAD_TO_SIGMA = 1.4826
SHORTEST_WINDOW = 5
MOST_CELLS = 40
PLANE_ROUNDS = 3


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
    causes = _without_leverage(causes, finite)
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


def _without_leverage(causes: Array, finite: BoolArray) -> Array:
    """Return causes cut at 3 robust deviations: a crack fakes lift-off, and must not explain itself by it."""
    middle = np.median(causes[finite], axis=0)
    reach = 3.0 * MAD_TO_SIGMA * np.median(np.abs(causes[finite] - middle), axis=0)
    return np.asarray(np.clip(causes, middle - reach, middle + reach))


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


def slow_over_surface(channel: Array, foot_mm: Array, *, cell_mm: float, radius_mm: float) -> Array:
    """Return a robust local plane over the surface: what neighbouring rows share and a crack is too small for.

    Parameters
    ----------
    channel : (M,) NaN left out
    foot_mm : (M, 3) [mm]
    cell_mm : float [mm]
        Readings are averaged in cubic cells of this size first.
    radius_mm : float [mm]
        Cells this near take part in the fit; a crack must cover well below half of them.
    """
    known = np.isfinite(channel)
    cell = np.floor(foot_mm[known] / cell_mm).astype(np.int64)
    _, number, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    place = np.stack([np.bincount(number, foot_mm[known, k]) / count for k in range(3)], axis=1)
    mean = np.bincount(number, channel[known]) / count
    tree = KDTree(place)
    reach = min(len(place), MOST_CELLS)
    distance, near = tree.query(place, k=reach)
    near = np.reshape(near, (-1, reach))
    smooth = _local_planes(place, mean, near, np.reshape(distance, (-1, reach)) <= radius_mm)
    weight_distance, at = tree.query(foot_mm[known], k=min(4, len(place)))
    weight = np.exp(-0.5 * (np.reshape(weight_distance, (known.sum(), -1)) / cell_mm) ** 2) + 1e-12
    out = np.full(len(channel), np.nan)
    out[known] = (weight * smooth[np.reshape(at, weight.shape)]).sum(axis=1) / weight.sum(axis=1)
    return out


def _local_planes(place: Array, value: Array, near: IntArray, inside: BoolArray) -> Array:
    """Return the value at each cell (K,) of a plane fitted robustly to the cells around it."""
    offset = place[near] - place[:, None]
    basis = np.concatenate([np.ones((*near.shape, 1)), offset], axis=2)
    data, keep = value[near], inside.astype(np.float64)
    ridge = np.diag([1e-9, 1e-2, 1e-2, 1e-2])
    middle = np.nanmedian(np.where(inside, data, np.nan), axis=1, keepdims=True)
    left = data - middle
    for _ in range(PLANE_ROUNDS):
        scale = MAD_TO_SIGMA * np.nanmedian(np.where(inside, np.abs(left), np.nan), axis=1, keepdims=True)
        floor = np.maximum(scale, 1e-9 * (np.abs(middle) + np.abs(data).max() + 1e-30))
        keep = inside * np.clip(1.0 - (left / (3.0 * floor)) ** 2, 0.0, 1.0) ** 2
        weighted = basis * keep[..., None]
        normal = np.swapaxes(weighted, 1, 2) @ basis + ridge
        fit = np.linalg.solve(normal, np.swapaxes(weighted, 1, 2) @ data[..., None])
        left = data - (basis @ fit)[..., 0]
    return np.asarray(fit[:, 0, 0])
