"""Lift-off from an impedance reading: the curve Z(h) as a spline, and its inverse with uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.impedance import impedance_change_ohm

KNOTS = 401
NEWTON_STEPS = 8
RELATIVE_NOISE = 1e-3


class LiftOffCurve:
    """Z(h) of one coil over one sound conductor at one frequency.

    Parameters
    ----------
    coil, conductor, frequency_hz
        As for `impedance_ohm`.
    max_lift_off_mm : float or None
        End of the curve; 2 outer radii when None.

    Attributes
    ----------
    air_ohm : complex
        j omega L0.
    max_lift_off_mm : float
    """

    def __init__(
        self, coil: Coil, conductor: Conductor, frequency_hz: float, *, max_lift_off_mm: float | None = None
    ) -> None:
        self.coil, self.conductor, self.frequency_hz = coil, conductor, frequency_hz
        self.max_lift_off_mm = 2 * coil.outer_radius_mm if max_lift_off_mm is None else max_lift_off_mm
        checks.positive("max_lift_off_mm", self.max_lift_off_mm, unit="mm")
        knots = self.max_lift_off_mm * np.linspace(0.0, 1.0, KNOTS) ** 1.5
        change = impedance_change_ohm(coil, conductor, frequency_hz, knots)
        self.air_ohm = 2j * np.pi * frequency_hz * air_inductance_h(coil)
        self._distance = np.abs(change)
        self._knots = knots
        self._change = CubicSpline(knots, change)
        self._slope = self._change.derivative()

    def impedance_ohm(self, lift_off_mm: ArrayLike) -> ComplexArray:
        """Return Z (...) [ohm] at lift-offs (...) [mm].

        Raises
        ------
        TechniqueError
            A lift-off is negative or beyond the curve's end.
        """
        h = np.asarray(lift_off_mm, dtype=np.float64)
        checks.lift_offs(h)
        if h.size and h.max() > self.max_lift_off_mm:
            raise TechniqueError(
                f"lift_off_mm = {h.max():g}: this curve ends at {self.max_lift_off_mm:g} mm. "
                "Build it with a larger max_lift_off_mm."
            )
        return np.asarray(self.air_ohm + self._change(h))

    def slope_ohm_mm(self, lift_off_mm: ArrayLike) -> ComplexArray:
        """Return dZ/dh (...) [ohm/mm]."""
        return np.asarray(self._slope(np.asarray(lift_off_mm, dtype=np.float64)))

    def lift_off_mm(self, impedance_ohm: ArrayLike, *, noise_ohm: float | None = None) -> tuple[Array, Array]:
        """Return the nearest point of the curve to each reading, by Newton projection.

        Parameters
        ----------
        impedance_ohm : (...) complex128 [ohm]
        noise_ohm : float or None
            Root mean square of a reading's complex noise (both parts together);
            0.1 % of the coil's air reactance when None.

        Returns
        -------
        lift_off : (...) float64 [mm]
            NaN where the nearest point lies outside the curve (a reading in air,
            or one "inside" the metal): such a spot has no known lift-off.
        sigma : (...) float64 [mm]
            Standard uncertainty noise / (sqrt(2) |dZ/dh|): the Cramer-Rao bound
            of one complex reading with the noise equal in both parts.
        """
        change = np.asarray(impedance_ohm, dtype=np.complex128) - self.air_ohm
        h = np.interp(-np.abs(change), -self._distance, self._knots)
        spread = self.max_lift_off_mm
        for _ in range(NEWTON_STEPS):
            slope = self._slope(h)
            step = np.real(np.conj(slope) * (change - self._change(h))) / np.abs(slope) ** 2
            h = np.clip(h + np.clip(step, -0.2 * spread, 0.2 * spread), -0.02 * spread, 1.02 * spread)
        noise = RELATIVE_NOISE * abs(self.air_ohm) if noise_ohm is None else noise_ohm
        sigma = noise / (np.sqrt(2) * np.abs(self._slope(h)))
        known = (h >= -3 * sigma) & (h > -0.019 * spread) & (h <= spread)
        return np.where(known, h, np.nan), np.where(known, sigma, np.inf)
