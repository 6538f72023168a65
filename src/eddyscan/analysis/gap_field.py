"""The gap between believed and true surface as a smooth field over scattered readings."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.analysis.background import robust_sigma
from eddyscan.core.footing import tangent_frames
from eddyscan.core.frames import Array

NEIGHBOURS = 28
ROBUST_ROUNDS = 2
READING_SIGMA_MM = 0.002
GROWTH_BEYOND = 0.01
COMMON_SIGMA_MM = 0.003  # what the coil's calibration leaves, the same everywhere
CELL_MM = 1.5


@dataclass(frozen=True)
class SurfaceCorrection:
    """How much further away the metal is than the mesh says, where the probe has been.

    Attributes
    ----------
    foot_mm : (M, 3) [mm, part] spots on the believed surface
    normal : (M, 3)
    gap_mm : (M,) [mm]
        Measured minus believed distance along the normal: positive where the true
        surface lies lower. Holds the pose's and the stage's repeatable errors too.
    spacing_mm : float [mm] typical distance of neighbouring readings
    width_mm : float [mm]
        Standard distance of the smoothing; never below the coil's outer radius.
    scatter_mm : float [mm] robust scatter of single readings about the smooth field
    frozen : int
        Readings left out because a signal other than lift-off spoke there.
    """

    foot_mm: Array
    normal: Array
    gap_mm: Array
    spacing_mm: float
    width_mm: float
    scatter_mm: float
    frozen: int

    def at(self, points_mm: Array) -> tuple[Array, Array]:
        """Return the smooth gap and its standard uncertainty at points (K, 3) [mm, part]: (K,), (K,) [mm]."""
        gap, sigma, _ = _smooth(self, points_mm)
        return gap, sigma


def gap_field(
    foot_mm: Array, normal: Array, gap_mm: Array, *, least_width_mm: float, frozen: int = 0
) -> SurfaceCorrection:
    """Build the field from readings (M, 3), (M, 3), (M,); dense ones are averaged in cells of 1.5 mm first."""
    foot, up, gap = _cell_means(foot_mm, normal, gap_mm)
    spacing = _spacing(foot)
    width = max(1.2 * spacing, least_width_mm)
    rough = SurfaceCorrection(foot, up, gap, spacing, width, READING_SIGMA_MM, frozen)
    smooth, _, _ = _smooth(rough, foot)
    return dataclasses.replace(rough, scatter_mm=max(robust_sigma(gap - smooth), READING_SIGMA_MM))


def _cell_means(foot_mm: Array, normal: Array, gap_mm: Array) -> tuple[Array, Array, Array]:
    """Return one mean reading per cubic cell, with the mean place it stands for."""
    cell = np.floor(foot_mm / CELL_MM).astype(np.int64)
    _, number, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()

    def mean(values: Array) -> Array:
        return np.bincount(number, values, minlength=len(count)) / count

    foot = np.stack([mean(foot_mm[:, k]) for k in range(3)], axis=1)
    up = np.stack([mean(normal[:, k]) for k in range(3)], axis=1)
    return foot, up / np.linalg.norm(up, axis=1, keepdims=True), mean(gap_mm)


def _spacing(foot_mm: Array) -> float:
    """Return the distance to the fourth neighbour: across rows as well as along."""
    distance, _ = KDTree(foot_mm).query(foot_mm, k=min(5, len(foot_mm)))
    return float(np.median(np.asarray(distance)[:, -1]))


def _smooth(correction: SurfaceCorrection, points_mm: Array) -> tuple[Array, Array, Array]:
    """Return gap, uncertainty and distance to the nearest reading by robust local quadratic regression."""
    k = min(NEIGHBOURS, len(correction.gap_mm))
    distance, near = KDTree(correction.foot_mm).query(points_mm, k=k)
    distance, near = np.reshape(distance, (len(points_mm), k)), np.reshape(near, (len(points_mm), k))
    frame = tangent_frames(correction.normal[near[:, 0]])
    local = np.einsum("kij,knj->kni", frame[:, :2], correction.foot_mm[near] - points_mm[:, None])
    s, t = local[..., 0] / correction.width_mm, local[..., 1] / correction.width_mm
    width = np.maximum(correction.width_mm, 0.7 * distance[:, : min(8, k)].max(axis=1))[:, None]
    weight = np.exp(-0.5 * (distance / width) ** 2)
    basis = np.stack([np.ones_like(s), s, t, s * s, s * t, t * t], axis=-1)
    value = correction.gap_mm[near]
    ridge = np.diag([1e-9, 1e-4, 1e-4, 1e-2, 1e-2, 1e-2])
    factor = np.ones_like(weight)
    for _ in range(ROBUST_ROUNDS + 1):
        weighted = basis * (weight * factor)[..., None]
        normal = np.swapaxes(weighted, 1, 2) @ basis + ridge
        fit = np.linalg.solve(normal, np.swapaxes(weighted, 1, 2) @ value[..., None])[..., 0]
        left = value - np.einsum("kni,ki->kn", basis, fit)
        scale = 4.0 * np.maximum(1.4826 * np.median(np.abs(left), axis=1, keepdims=True), correction.scatter_mm)
        factor = np.clip(1.0 - (left / scale) ** 2, 0.0, 1.0) ** 2
    count = np.maximum((weight * factor).sum(axis=1), 1e-3)
    spread = np.sqrt((weight * factor * left**2).sum(axis=1) / count + correction.scatter_mm**2)
    beyond = np.maximum(distance[:, 0] - correction.spacing_mm, 0.0)
    sigma = np.hypot(spread / np.sqrt(count), GROWTH_BEYOND * beyond)
    return fit[:, 0], np.hypot(sigma, COMMON_SIGMA_MM), distance[:, 0]
