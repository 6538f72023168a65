"""Lift-off and conductivity together, from one complex reading or from several frequencies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RectBivariateSpline

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.impedance import impedance_change_ohm

STEPS = 12
HEIGHTS, CONDUCTIVITIES = 81, 33


@dataclass(frozen=True)
class JointEstimate:
    """Lift-off and conductivity of each reading.

    Attributes
    ----------
    lift_off_mm, conductivity_ms_m : (N,), NaN where the readings lie outside the model's range
    lift_off_sigma_mm, conductivity_sigma_ms_m : (N,) standard uncertainties (Cramer-Rao bound)
    """

    lift_off_mm: Array
    conductivity_ms_m: Array
    lift_off_sigma_mm: Array
    conductivity_sigma_ms_m: Array


class JointModel:
    """Z over a half-space as a table over lift-off and conductivity, at one or more frequencies.

    Parameters
    ----------
    coil : Coil
    frequencies_hz : sequence of float
    conductivity_range_ms_m : (low, high) [MS/m]
    max_lift_off_mm : float or None
        One outer radius when None.

    Raises
    ------
    TechniqueError
        No frequency, or a range that is empty or implausible.
    """

    def __init__(
        self,
        coil: Coil,
        frequencies_hz: ArrayLike,
        *,
        conductivity_range_ms_m: tuple[float, float],
        max_lift_off_mm: float | None = None,
    ) -> None:
        self.frequencies_hz = np.atleast_1d(np.asarray(frequencies_hz, dtype=np.float64))
        low, high = conductivity_range_ms_m
        for value in conductivity_range_ms_m:
            checks.positive("conductivity_range_ms_m", value, unit="MS/m")
            checks.conductivity("conductivity_range_ms_m", value)
        if not low < high or self.frequencies_hz.size == 0:
            raise TechniqueError(
                f"conductivity_range_ms_m = ({low:g}, {high:g}) and {self.frequencies_hz.size} frequencies: "
                "the range must rise and at least one frequency is needed."
            )
        top = coil.outer_radius_mm if max_lift_off_mm is None else max_lift_off_mm
        self._h = top * np.linspace(0.0, 1.0, HEIGHTS) ** 1.5
        self._s = np.log(np.geomspace(low, high, CONDUCTIVITIES))
        self.air_ohm = 2j * np.pi * self.frequencies_hz * air_inductance_h(coil)
        self._tables = [self._table(coil, float(frequency)) for frequency in self.frequencies_hz]

    def _table(self, coil: Coil, frequency_hz: float) -> tuple[RectBivariateSpline, RectBivariateSpline]:
        columns = [
            impedance_change_ohm(coil, Conductor.half_space(float(np.exp(s))), frequency_hz, self._h) for s in self._s
        ]
        change = np.stack(columns, axis=1)
        return (
            RectBivariateSpline(self._h, self._s, change.real, s=0),
            RectBivariateSpline(self._h, self._s, change.imag, s=0),
        )

    def _evaluate(self, h: Array, s: Array, dx: int = 0, dy: int = 0) -> ComplexArray:
        rows = [real.ev(h, s, dx=dx, dy=dy) + 1j * imag.ev(h, s, dx=dx, dy=dy) for real, imag in self._tables]
        return np.stack(rows, axis=1)

    def estimate(self, impedance_ohm: ArrayLike, *, noise_ohm: ArrayLike) -> JointEstimate:
        """Fit lift-off and conductivity to each reading by Gauss-Newton, weighted with the noise.

        Parameters
        ----------
        impedance_ohm : (N,) or (N, F) complex128 [ohm], one column per frequency
        noise_ohm : float or (F,) [ohm]
            Root mean square of the complex noise of a reading.
        """
        z = np.asarray(impedance_ohm, dtype=np.complex128)
        z = z.reshape(-1, len(self.frequencies_hz)) - self.air_ohm
        weight = np.sqrt(2) / np.broadcast_to(np.asarray(noise_ohm, dtype=np.float64), (z.shape[1],))
        h, s = self._start(z)
        for _ in range(STEPS):
            slope_h, slope_s = self._evaluate(h, s, dx=1) * weight, self._evaluate(h, s, dy=1) * weight
            missing = (z - self._evaluate(h, s)) * weight
            hh, ss, hs = _dot(slope_h, slope_h), _dot(slope_s, slope_s), _dot(slope_h, slope_s)
            rh, rs = _dot(slope_h, missing), _dot(slope_s, missing)
            determinant = hh * ss - hs**2
            h = np.clip(h + np.clip((ss * rh - hs * rs) / determinant, -0.3, 0.3), self._h[0], self._h[-1])
            s = np.clip(s + np.clip((hh * rs - hs * rh) / determinant, -0.5, 0.5), self._s[0], self._s[-1])
        inside = (h > self._h[0]) & (h < self._h[-1]) & (s > self._s[0]) & (s < self._s[-1])
        h, sigma = np.where(inside, h, np.nan), np.where(inside, np.exp(s), np.nan)
        return JointEstimate(h, sigma, np.sqrt(ss / determinant), np.exp(s) * np.sqrt(hh / determinant))

    def _start(self, z: ComplexArray) -> tuple[Array, Array]:
        heights, conductivities = np.meshgrid(self._h[1:-1:8], self._s[1:-1:4], indexing="ij")
        h, s = heights.ravel(), conductivities.ravel()
        known = self._evaluate(h, s)
        best = np.array([np.argmin(np.sum(np.abs(known - row) ** 2, axis=1)) for row in z])
        return h[best], s[best]


def _dot(a: ComplexArray, b: ComplexArray) -> Array:
    return np.asarray(np.sum((np.conj(a) * b).real, axis=1))
