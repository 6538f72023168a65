"""What a sound part reads at every lift-off and tilt: the curve that readings are compared with.

The curve is tabulated once from the physics over the clearance of
the coil's rim (lift-off minus what tilt takes of it) and the tilt, so that every
table entry is a coil above the metal. Readings are tied to it by what the coil
reads in air: the wire's resistance and the cable shift the air point, a winding
that differs by a few per cent scales it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.interpolate import RectBivariateSpline

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.technique import Technique
from eddyscan.physics.coil import MU0, Coil, air_inductance_h, wave_numbers
from eddyscan.physics.conductor import Conductor, reflection
from eddyscan.physics.impedance import laplace_sum, power_spectrum

CLEARANCE_KNOTS = 161
LARGEST_TILT_DEG = 30.0
TILT_STEP_DEG = 4.5
LAST_WAVE_NUMBER = 30.0
NEWTON_STEPS = 8
LARGEST_SIZE_ERROR = 0.2


@dataclass(frozen=True)
class Projection:
    """Readings taken apart into lift-off and what it cannot explain.

    Attributes
    ----------
    lift_off_mm : (M,) [mm]; NaN where the reading lies beyond the table
    residual_ohm : (M,) complex [ohm]
        Reading minus the nearest point of the curve, unrotated.
    tangent_ohm_mm : (M,) complex [ohm/mm]
        Change of the reading per mm of lift-off at that point.
    """

    lift_off_mm: Array
    residual_ohm: ComplexArray
    tangent_ohm_mm: ComplexArray

    @property
    def across_ohm(self) -> Array:
        """Return the signed residual (M,) [ohm] across the curve, 90 deg ahead of falling lift-off."""
        falling = -self.tangent_ohm_mm / np.abs(self.tangent_ohm_mm)
        return np.asarray((self.residual_ohm * np.conj(falling)).imag)


@dataclass(frozen=True)
class SoundResponse:
    """Impedance of the coil over sound metal.

    Attributes
    ----------
    coil : Coil
    conductor : Conductor
    frequency_hz : float [Hz]
    air_ohm : complex [ohm]
        Reading in air; the curve starts there.
    reactance_air_ohm : float [ohm]
        X0 of the modelled coil.
    largest_clearance_mm : float [mm]
        Upper end of the table.
    largest_tilt_deg : float [deg]
    """

    coil: Coil
    conductor: Conductor
    frequency_hz: float
    air_ohm: complex
    reactance_air_ohm: float
    largest_clearance_mm: float
    largest_tilt_deg: float
    _real: RectBivariateSpline = field(repr=False)
    _imag: RectBivariateSpline = field(repr=False)

    @property
    def gain(self) -> float:
        """Return measured over modelled reactance in air."""
        return self.air_ohm.imag / self.reactance_air_ohm

    def rim_mm(self, tilt_deg: Array) -> Array:
        """Return how much lower the rim of the coil face hangs than its centre [mm]."""
        return np.asarray(self.coil.outer_radius_mm * np.sin(np.radians(tilt_deg)))

    def impedance_ohm(self, lift_off_mm: Array, tilt_deg: Array) -> ComplexArray:
        """Return what the instrument reads over sound metal (M,) [ohm]."""
        return self._at(lift_off_mm - self.rim_mm(tilt_deg), tilt_deg)[0]

    def project(self, impedance_ohm: ComplexArray, tilt_deg: Array) -> Projection:
        """Find the lift-off whose reading is nearest to each measured one.

        Parameters
        ----------
        impedance_ohm : (M,) complex [ohm], as read
        tilt_deg : (M,) [deg] angle between probe axis and surface normal
        """
        change = np.abs(impedance_ohm - self.air_ohm)
        knots = np.linspace(0.0, self.largest_clearance_mm, 400)
        reference = np.abs(self._at(knots, np.zeros_like(knots))[0] - self.air_ohm)
        clearance = np.interp(-change, -reference, knots)
        for _ in range(NEWTON_STEPS):
            point, slope = self._at(clearance, tilt_deg)
            step = (np.conj(slope) * (impedance_ohm - point)).real / np.abs(slope) ** 2
            clearance = np.clip(clearance + np.clip(step, -0.5, 0.5), -0.5, self.largest_clearance_mm)
            if np.abs(step).max() < 1e-7:
                break
        point, slope = self._at(clearance, tilt_deg)
        beyond = (clearance >= self.largest_clearance_mm) | (tilt_deg > self.largest_tilt_deg)
        lift_off = np.where(beyond, np.nan, clearance + self.rim_mm(tilt_deg))
        return Projection(lift_off, np.where(beyond, np.nan, impedance_ohm - point), slope)

    def _at(self, clearance_mm: Array, tilt_deg: Array) -> tuple[ComplexArray, ComplexArray]:
        """Return the reading and its slope per mm; straight on below zero clearance."""
        inside = np.clip(clearance_mm, 0.0, self.largest_clearance_mm)
        tilt = np.clip(tilt_deg, 0.0, self.largest_tilt_deg)
        slope = self._real.ev(inside, tilt, dx=1) + 1j * self._imag.ev(inside, tilt, dx=1)
        value = self._real.ev(inside, tilt) + 1j * self._imag.ev(inside, tilt)
        return self.air_ohm + value + slope * (clearance_mm - inside), slope


def sound_response(
    coil: Coil,
    conductor: Conductor,
    frequency_hz: float,
    *,
    air_ohm: complex | None = None,
    largest_lift_off_mm: float = 4.0,
    largest_tilt_deg: float = 0.0,
) -> SoundResponse:
    """Tabulate the sound part's curve.

    Parameters
    ----------
    air_ohm : complex [ohm], optional
        Reading in air. Without it the modelled coil's own reactance stands in and
        the wire has no resistance.
    largest_lift_off_mm : float [mm]
    largest_tilt_deg : float [deg]
        Tilts up to this are tabulated (at most `LARGEST_TILT_DEG`).
    """
    steps = int(np.ceil(min(largest_tilt_deg, LARGEST_TILT_DEG) / TILT_STEP_DEG - 1e-9))
    tilts: Array = TILT_STEP_DEG * np.arange(max(steps, 1) + 1, dtype=np.float64)
    knots = largest_lift_off_mm * np.linspace(0.0, 1.0, CLEARANCE_KNOTS) ** 1.5
    x0 = _air_reactance_ohm(coil, frequency_hz)
    air = complex(0.0, x0) if air_ohm is None else air_ohm
    columns = [_change_ohm(coil, conductor, frequency_hz, float(tilt), largest_lift_off_mm) for tilt in tilts]
    change = np.stack(columns, axis=1) * (air.imag / x0)
    spline = _spline(knots, tilts)
    parts = spline(change.real), spline(change.imag)
    return SoundResponse(coil, conductor, frequency_hz, air, x0, largest_lift_off_mm, float(tilts[-1]), *parts)


@lru_cache(maxsize=64)
def _air_reactance_ohm(coil: Coil, frequency_hz: float) -> float:
    return float(2 * np.pi * frequency_hz * air_inductance_h(coil))


@lru_cache(maxsize=256)
def _change_ohm(
    coil: Coil, conductor: Conductor, frequency_hz: float, tilt_deg: float, largest_lift_off_mm: float
) -> ComplexArray:
    """Return the change against air (CLEARANCE_KNOTS,) [ohm] at the table's clearances.

    The sum over wave numbers ends at 30 over the outer radius: the source falls as k^-5
    beyond, so 1e-6 of the change is left out, for a tenth of the time.
    """
    clearance_m = 1e-3 * largest_lift_off_mm * np.linspace(0.0, 1.0, CLEARANCE_KNOTS) ** 1.5
    k, weight = wave_numbers(coil, finest_m=coil.outer_m * 40.0 / LAST_WAVE_NUMBER)
    spectrum = weight * reflection(conductor, k, frequency_hz) * power_spectrum(coil, k, tilt_deg)
    scale = 2j * np.pi * frequency_hz * np.pi * MU0 * coil.turn_density**2
    return np.asarray(scale * laplace_sum(k, spectrum, 2.0 * clearance_m))


def technique_coil(technique: Technique) -> Coil:
    """Return the technique's coil as drawn."""
    probe = technique.probe
    return Coil(probe.inner_radius_mm, probe.outer_radius_mm, probe.length_mm, probe.turns)


def technique_conductor(technique: Technique) -> Conductor:
    """Return the technique's metal as a half-space."""
    return Conductor.half_space(technique.part.conductivity_ms_m)


def _spline(knots: Array, tilts: Array) -> Callable[[Array], RectBivariateSpline]:
    return lambda values: RectBivariateSpline(knots, tilts, values, kx=3, ky=min(3, len(tilts) - 1))


def curvature_gap_mm(coil: Coil, lift_off_mm: Array, curvature_per_mm: Array) -> Array:
    """Return the extra lift-off a curved surface seems to have (M,) [mm].

    r_eff^2 / 4 times the sum of the principal curvatures (convex positive). The
    line r_eff = r2 (0.793 + 0.6 h / r2) goes through the values of the series
    solution for a conducting sphere, 1.25 mm at h = 0.1 mm and 1.37 mm at 0.3 mm
    for r2 = 1.5 mm; constant beyond h = r2 / 2. First order: below a radius of ten
    outer radii it is a guess.
    """
    r2 = coil.outer_radius_mm
    effective = r2 * (0.793 + 0.6 * np.clip(lift_off_mm / r2, 0.0, 0.5))
    return np.asarray(0.25 * effective**2 * curvature_per_mm)


def coil_by_air_reading(coil: Coil, air_ohm: complex, frequency_hz: float) -> Coil:
    """Return the coil scaled so that its air reactance is the measured one.

    The number of turns is counted, sizes are not: at equal shape the inductance is
    proportional to size, so a reactance 2 % high is a winding 2 % large.

    Raises
    ------
    TechniqueError
        When the reading is more than 20 % off: another coil, frequency or cable.
    """
    x0 = _air_reactance_ohm(coil, frequency_hz)
    size = air_ohm.imag / x0
    if not abs(size - 1.0) <= LARGEST_SIZE_ERROR:
        raise TechniqueError(
            f"the coil reads {air_ohm.imag:.4g} ohm of reactance in air, its drawing gives {x0:.4g} ohm "
            f"({100 * (size - 1):+.0f} %, limit {100 * LARGEST_SIZE_ERROR:.0f} %). "
            "Check the probe's dimensions and turns in the technique, the frequency and the cable."
        )
    return Coil(coil.inner_radius_mm * size, coil.outer_radius_mm * size, coil.length_mm * size, coil.turns)
