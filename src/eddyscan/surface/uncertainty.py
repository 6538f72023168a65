"""How well each spot of a fused height field is known: a standard uncertainty along the normal.

Neighbouring pixels of a stereo camera share their noise, and each view carries
its own calibration and pose error, so counting pixels would state far too
little. Views are compared block by block instead: how much their block means
scatter about the fused surface is all error that does not average out within a
view, and the fused surface carries that scatter divided by the number of views.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from eddyscan.core.frames import Array
from eddyscan.surface.cells import HeightCells
from eddyscan.surface.height_field import HeightField
from eddyscan.surface.spline import pointwise_variance

BLOCK_MM = 10.0
MIN_CELLS = 20
LEVERAGE_STEP_MM = 8.0
LEVERAGE_LIMITS = (0.6, 6.0)
DATUM_SIDEWAYS_MM = 0.08  # scatter of the outline's place: the views' border offsets, averaged over a side
SINGLE_VIEW_MM = 0.15  # nothing to compare with: what the sensor's correlated noise and bias leave
FLOOR_MM = 0.02


@dataclass(frozen=True)
class Uncertainty:
    """Standard uncertainty over the part.

    Attributes
    ----------
    shape_mm : float
        Typical, of the shape alone.
    at : interpolated relative leverage over (x, y)
    """

    shape_mm: float
    at: RegularGridInterpolator

    def along_normal(self, xy: Array, normal_z: Array) -> Array:
        """Return the standard uncertainty [mm] at points (N, 2) whose normals have z component (N,).

        Shape, height of the table and place of the outline add up as variances.
        """
        shape = (self.shape_mm**2) * np.asarray(self.at(xy))
        datum = (self.shape_mm * normal_z) ** 2 + DATUM_SIDEWAYS_MM**2 * (1 - normal_z**2)
        return np.asarray(np.sqrt(shape + datum + FLOOR_MM**2))


def estimate_uncertainty(field: HeightField, cells: HeightCells) -> Uncertainty:
    """Compare the views block by block and spread the result by the spline's own leverage."""
    shape = _between_views(field, cells)
    x, y = cells.centres()
    low, high = np.array([x[0], y[0]]), np.array([x[-1], y[-1]])
    n = np.maximum(np.round((high - low) / LEVERAGE_STEP_MM).astype(int), 1) + 1
    gx, gy = (np.linspace(low[k], high[k], n[k]) for k in range(2))
    variance = pointwise_variance(field.factor, field.fit, gx, gy)
    relative = np.clip(variance / max(float(np.median(variance)), 1e-12), *LEVERAGE_LIMITS)
    return Uncertainty(shape, RegularGridInterpolator((gx, gy), relative, bounds_error=False, fill_value=None))


def _between_views(field: HeightField, cells: HeightCells) -> float:
    """Return the standard uncertainty [mm] of the mean of all views at a typical spot."""
    size = np.maximum(np.round(BLOCK_MM / cells.cell_mm).astype(int), 1)
    means = np.stack([_block_means(r, w, size) for r, w in zip(field.residual, field.weight, strict=True)])
    seen = np.isfinite(means)
    count = seen.sum(axis=0)
    several = count > 1
    if not several.any():
        return SINGLE_VIEW_MM
    total = np.where(seen, means, 0.0).sum(axis=0)
    centred = np.where(seen, means - total / np.maximum(count, 1), 0.0)
    variance = (centred**2).sum(axis=0)[several] / (count[several] - 1)
    return float(np.sqrt(np.median(variance / count[several]) * MEDIAN_TO_MEAN))


MEDIAN_TO_MEAN = 1.2  # of a chi-square with the four degrees of freedom that five views leave


def _block_means(residual: Array, weight: Array, size: Array) -> Array:
    nx, ny = (np.array(residual.shape) // size) * size
    shape = (nx // size[0], size[0], ny // size[1], size[1])
    w = weight[:nx, :ny].reshape(shape)
    value = np.nan_to_num(residual[:nx, :ny]).reshape(shape)
    total, count = w.sum(axis=(1, 3)), (w > 0).sum(axis=(1, 3))
    mean = np.divide((w * value).sum(axis=(1, 3)), total, out=np.zeros_like(total), where=total > 0)
    return np.asarray(np.where(count >= MIN_CELLS, mean, np.nan))
