"""The coil as it is: its winding fitted to the air reading and to an approach, or to shims.

A real winding differs from its drawing by a few per cent in every dimension, which
is 10-30 um of lift-off. The number of turns is counted; sizes are found from what
the coil reads in air and at several heights over sound metal whose differences are
known (a stage's own steps, or shims), with the drawing as a prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.impedance import impedance_change_ohm

LEAST_HEIGHTS = 5
ITERATIONS = 8
STEP = 1e-3
SIZE_SIGMA = 0.012
CONDUCTIVITY_SIGMA = 0.01
AIR_SIGMA = 2e-3


@dataclass(frozen=True)
class CoilCalibration:
    """A fitted coil.

    Attributes
    ----------
    coil : Coil
    conductivity_ms_m : float
    offset_mm : float [mm]
        Lift-off = height - offset; 0 for shims.
    offset_sigma_mm : float [mm] standard uncertainty of the offset
    residual_ohm : float [ohm] rms of the fit
    """

    coil: Coil
    conductivity_ms_m: float
    offset_mm: float
    offset_sigma_mm: float
    residual_ohm: float


def calibrate_coil(
    drawn: Coil,
    conductivity_ms_m: float,
    frequency_hz: float,
    *,
    height_mm: Array,
    impedance_ohm: ComplexArray,
    air_ohm: complex,
    noise_ohm: float,
    absolute: bool = False,
) -> CoilCalibration:
    """Fit winding sizes, conductivity and the height of the metal.

    Parameters
    ----------
    drawn : Coil
    conductivity_ms_m : float of the metal, known to about 1 %
    frequency_hz : float [Hz]
    height_mm : (K,) [mm]
        Heights of the coil face along the surface normal from any common zero; with
        `absolute` they are lift-offs (shims).
    impedance_ohm : (K,) complex [ohm]
    air_ohm : complex [ohm] reading in air
    noise_ohm : float [ohm] standard deviation of one part of a reading
    absolute : bool

    Raises
    ------
    TechniqueError
        Fewer than five heights, or heights that span less than a third of the outer radius.
    """
    _require_span(drawn, height_mm)
    h = np.asarray(height_mm, dtype=np.float64)
    near = float(h.min())
    begin = 0.0 if absolute else near - _first_lift_off(drawn, conductivity_ms_m, frequency_hz, impedance_ohm, air_ohm)
    x = np.zeros(5)
    problem = _Problem(drawn, conductivity_ms_m, frequency_hz, h, impedance_ohm, air_ohm, noise_ohm, begin, absolute)
    information = np.eye(5)
    for _ in range(ITERATIONS):
        r = problem.residual(x)
        J = np.stack([(problem.residual(x + STEP * unit) - r) / STEP for unit in np.eye(5)], axis=1)
        information = J.T @ J
        step = np.linalg.solve(information, -J.T @ r)
        x = x + np.clip(step, -0.05, 0.05)
        if np.abs(step).max() < 1e-6:
            break
    signal = problem.residual(x)[: 2 * len(h)]
    return CoilCalibration(
        problem.coil(x),
        conductivity_ms_m * (1 + float(x[3])),
        begin + float(x[4]),
        0.0 if absolute else float(np.sqrt(np.linalg.inv(information)[4, 4])),
        float(noise_ohm * np.sqrt(2 * np.mean(signal**2))),
    )


@dataclass(frozen=True)
class _Problem:
    """Residuals in units of their standard uncertainty: readings, air reactance, priors."""

    drawn: Coil
    conductivity_ms_m: float
    frequency_hz: float
    height_mm: Array
    impedance_ohm: ComplexArray
    air_ohm: complex
    noise_ohm: float
    begin_mm: float
    absolute: bool

    def coil(self, x: Array) -> Coil:
        r1, r2, length = (1.0 + float(value) for value in x[:3])
        d = self.drawn
        return Coil(d.inner_radius_mm * r1, d.outer_radius_mm * r2, d.length_mm * length, d.turns)

    def residual(self, x: Array) -> Array:
        coil = self.coil(x)
        metal = Conductor.half_space(self.conductivity_ms_m * (1 + x[3]))
        lift_off = np.maximum(self.height_mm - self.begin_mm - (0.0 if self.absolute else x[4]), 1e-4)
        model = impedance_change_ohm(coil, metal, self.frequency_hz, lift_off)
        left = (self.impedance_ohm - self.air_ohm - model) / self.noise_ohm
        x0 = 2 * np.pi * self.frequency_hz * air_inductance_h(coil)
        air = (self.air_ohm.imag / x0 - 1.0) / AIR_SIGMA
        prior = np.append(x[:3] / SIZE_SIGMA, x[3] / CONDUCTIVITY_SIGMA)
        loose = x[4] / (1e-6 if self.absolute else 1.0)
        return np.concatenate([left.real, left.imag, [air], prior, [loose]])


def _first_lift_off(
    drawn: Coil, conductivity_ms_m: float, frequency_hz: float, impedance_ohm: ComplexArray, air_ohm: complex
) -> float:
    """Return the lift-off [mm] of the strongest reading by the drawing."""
    knots = np.linspace(0.0, 2 * drawn.outer_radius_mm, 200)
    model = np.abs(impedance_change_ohm(drawn, Conductor.half_space(conductivity_ms_m), frequency_hz, knots))
    return float(np.interp(-np.abs(impedance_ohm - air_ohm).max(), -model, knots))


def _require_span(drawn: Coil, height_mm: Array) -> None:
    if len(height_mm) < LEAST_HEIGHTS:
        raise TechniqueError(
            f"a coil calibration needs at least {LEAST_HEIGHTS} heights, {len(height_mm)} were given. Add some."
        )
    span = float(np.max(height_mm) - np.min(height_mm))
    if span < drawn.outer_radius_mm / 3:
        raise TechniqueError(
            f"the heights span {span:.3g} mm, a coil of {drawn.outer_radius_mm:g} mm outer radius needs at least "
            f"{drawn.outer_radius_mm / 3:.3g} mm to show its size. Add higher shims or steps."
        )
