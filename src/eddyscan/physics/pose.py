"""A coil that stands askew on a curved surface: tilt by a table, curvature as effective lift-off."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline, make_interp_spline

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, BoolArray, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, Coil, air_inductance_h, source, wave_numbers
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.impedance import impedance_change_ohm, least_lift_off_mm

TILT_STEP_DEG = 3.0
CLEARANCES = 48
TIGHTEST_RADIUS_COILS = 10.0
SLOT_TILT_DEG = 5.0


class PoseCurve:
    """Z of one coil over one sound conductor for any lift-off and tilt, as a table over rim clearance and tilt.

    Parameters
    ----------
    coil, conductor, frequency_hz
        As for `impedance_ohm`.
    max_lift_off_mm : float or None
        2 outer radii when None.
    max_tilt_deg : float
        Below 80.
    """

    def __init__(
        self,
        coil: Coil,
        conductor: Conductor,
        frequency_hz: float,
        *,
        max_lift_off_mm: float | None = None,
        max_tilt_deg: float = 36.0,
    ) -> None:
        self.coil, self.frequency_hz, self.max_tilt_deg = coil, frequency_hz, max_tilt_deg
        self.max_lift_off_mm = 2 * coil.outer_radius_mm if max_lift_off_mm is None else max_lift_off_mm
        checks.positive("max_lift_off_mm", self.max_lift_off_mm, unit="mm")
        checks.positive("max_tilt_deg", max_tilt_deg, unit="deg")
        least_lift_off_mm(coil, max_tilt_deg)
        self.air_ohm = 2j * np.pi * frequency_hz * air_inductance_h(coil)
        clearance = self.max_lift_off_mm * np.linspace(0.0, 1.0, CLEARANCES) ** 1.8
        tilts = np.linspace(0.0, max_tilt_deg, 2 + max(3, int(max_tilt_deg / TILT_STEP_DEG)))
        values = np.array(
            [
                impedance_change_ohm(coil, conductor, frequency_hz, clearance + least_lift_off_mm(coil, tilt), tilt)
                for tilt in tilts
            ]
        )
        along_tilt = make_interp_spline(tilts, values, k=3)
        across = make_interp_spline(clearance, along_tilt.c, k=3, axis=1)
        self._spline = NdBSpline((along_tilt.t, across.t), np.ascontiguousarray(np.moveaxis(across.c, 0, 1)), 3)

    def impedance_ohm(self, lift_off_mm: ArrayLike, tilt_deg: ArrayLike = 0.0, *, rest: bool = False) -> ComplexArray:
        """Return Z (...) [ohm].

        Parameters
        ----------
        lift_off_mm : (...) float64 [mm]
            Face centre to surface along the normal.
        tilt_deg : (...) float64 [deg]
        rest : bool
            A probe that would cut into the part rests on its rim instead, as a
            sprung probe does; otherwise such a pose is an error.

        Raises
        ------
        TechniqueError
            Outside the table, or (without `rest`) a rim that cuts into the part.
        """
        h, tilt = np.broadcast_arrays(np.asarray(lift_off_mm, np.float64), np.abs(np.asarray(tilt_deg, np.float64)))
        if tilt.size and not tilt.max() <= self.max_tilt_deg:
            raise TechniqueError(
                f"tilt_deg = {tilt.max():g}: this table ends at {self.max_tilt_deg:g} deg. "
                "Build it with a larger max_tilt_deg."
            )
        clearance = h - self.coil.outer_radius_mm * np.sin(np.radians(tilt))
        if rest:
            clearance = np.maximum(clearance, 0.0)
        checks.lift_offs(clearance, reason="clearance of the tilted coil's rim: it would cut into the part")
        if clearance.size and clearance.max() > self.max_lift_off_mm:
            raise TechniqueError(
                f"lift_off_mm = {h.max():g}: this table ends at {self.max_lift_off_mm:g} mm. "
                "Build it with a larger max_lift_off_mm."
            )
        points = np.stack([tilt.ravel(), clearance.ravel()], axis=1)
        return np.asarray(self.air_ohm + self._spline(points).reshape(h.shape))


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
