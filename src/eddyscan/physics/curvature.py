"""A coil over a curved surface: curvature as effective lift-off, and where that ends."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from eddyscan.core.frames import Array, BoolArray
from eddyscan.physics.coil import MM, Coil, source, wave_numbers

TIGHTEST_RADIUS_COILS = 10.0


def effective_radius_mm(coil: Coil, lift_off_mm: ArrayLike, skin_depth_mm: float = 0.0) -> Array:
    """Return the radius [mm] at which the surface's fall-away acts like lift-off (...).

    A surface that falls away by r^2 kappa / 2 changes the signal, to first order, by
    the fall-away weighted with the squared surface field H_r(r)^2; so r_eff^2 is
    the mean of r^2 under H_r^2. In the Hankel domain, with f = M(k) exp(-k h):
    r_eff^2 = integral of (f'^2 + f^2/k^2) k dk / integral of f^2 k dk. The metal's
    surface counts as half a skin depth deeper.
    """
    h = np.asarray(lift_off_mm, dtype=np.float64) + 0.5 * skin_depth_mm
    heights, radii = _effective_radii(coil)
    return np.asarray(np.interp(h, heights, radii))


@lru_cache(maxsize=16)
def _effective_radii(coil: Coil) -> tuple[Array, Array]:
    heights = coil.outer_radius_mm * np.linspace(0.0, 2.0, 60) ** 1.5
    k, w = wave_numbers(coil)
    step = 1e-4 * k
    slope = (source(coil, k + step) - source(coil, k - step)) / (2 * step)
    own = source(coil, k)
    radii = []
    for h in heights * MM:
        decay = np.exp(-2 * k * h)
        weighted = ((slope - h * own) ** 2 + (own / k) ** 2) * k * decay
        radii.append(np.sqrt((w @ weighted) / (w @ (own**2 * k * decay))) / MM)
    return heights, np.array(radii)


def curved_lift_off_mm(
    coil: Coil, lift_off_mm: ArrayLike, curvature_sum_per_mm: ArrayLike, *, skin_depth_mm: float = 0.0
) -> Array:
    """Return the flat-surface lift-off (...) [mm] that reads like `lift_off_mm` over a curved surface.

    h_eff = h + r_eff^2 / 4 (kappa_1 + kappa_2), curvatures [1/mm] positive where
    the surface falls away (convex). First order: good to a few um where no radius
    of curvature is below ten outer coil radii (`too_curved`). Never below zero.
    """
    h = np.asarray(lift_off_mm, dtype=np.float64)
    extra = 0.25 * effective_radius_mm(coil, h, skin_depth_mm) ** 2 * np.asarray(curvature_sum_per_mm, np.float64)
    return np.asarray(np.maximum(h + extra, 0.0))


def too_curved(coil: Coil, largest_curvature_per_mm: ArrayLike) -> BoolArray:
    """Return where (...) the surface bends tighter than ten outer coil radii: no crack calls there."""
    limit = 1.0 / (TIGHTEST_RADIUS_COILS * coil.outer_radius_mm)
    return np.asarray(np.abs(np.asarray(largest_curvature_per_mm, dtype=np.float64)) > limit)
