"""What the coil of the virtual cell feels: closed-form impedance at any clearance and tilt, fast.

The upright coil is `LiftOffCurve`; tilt enters as a factor on the change,
tabulated from the exact tilted-coil integral on first use; curvature as extra
lift-off (`world_probe`). Edges have no model: up to the rim the surface is taken to go on,
beyond it the coil leaves the metal by its plain distance to the rim. Readings
within 1.7 outer radii of an edge are therefore not physics, and the truth
marks them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline

from eddyscan.core.frames import ComplexArray
from eddyscan.devices.sim.world_settings import WorldCoil
from eddyscan.physics import Coil, Conductor, air_inductance_h, impedance_change_ohm, least_lift_off_mm
from eddyscan.physics.conductor import reflection
from eddyscan.physics.impedance import laplace_sum, power_spectrum
from eddyscan.physics.quadrature import gauss_panels

FARTHEST_MM = 40.0
KNOTS = 700
TILTS_DEG = (0.0, 2.0, 5.0, 9.0, 14.0, 20.0, 27.0, 35.0, 44.0, 54.0, 65.0)
CLEARANCES_MM = 12.0 * np.linspace(0.0, 1.0, 30) ** 2
LEAST_TILT_DEG = 0.02
EDGE_RADII = 1.7


def real_coil(nominal: WorldCoil, tolerance: float, seed: int) -> Coil:
    """Return this copy of the coil: each size off by its own draw within `tolerance`, the turns as counted."""
    r1, r2, length = 1.0 + tolerance * np.random.default_rng([seed, 6]).uniform(-1, 1, 3)
    return Coil(nominal.inner_radius_mm * r1, nominal.outer_radius_mm * r2, nominal.length_mm * length, nominal.turns)


class CoilResponse:
    """Impedance of one coil over one sound conductor at one frequency.

    Attributes
    ----------
    air_ohm : complex
        j omega L0, without the wire's resistance.
    """

    def __init__(self, coil: Coil, conductor: Conductor, frequency_hz: float) -> None:
        self.coil, self.conductor, self.frequency_hz = coil, conductor, frequency_hz
        self.air_ohm = 2j * np.pi * frequency_hz * air_inductance_h(coil)
        self._knots = FARTHEST_MM * np.linspace(0.0, 1.0, KNOTS) ** 2
        changes = impedance_change_ohm(coil, conductor, frequency_hz, self._knots)
        self._upright, self._sizes = CubicSpline(self._knots, changes), np.abs(changes)
        self._rows: dict[float, ComplexArray] = {}
        self._tilt_end = 0
        self._factor: tuple[RectBivariateSpline, RectBivariateSpline] | None = None

    def impedance_ohm(self, lift_off_mm: float, tilt_deg: float) -> complex:
        """Return Z [ohm] for a face centre at `lift_off_mm`; a coil that would cut the metal rests on it."""
        tilt = min(abs(tilt_deg), TILTS_DEG[-1])
        height = max(lift_off_mm, least_lift_off_mm(self.coil, tilt))
        if height >= FARTHEST_MM:
            return self.air_ohm
        change = complex(self._upright(height))
        if tilt > LEAST_TILT_DEG:
            change *= self._tilt_factor(height - least_lift_off_mm(self.coil, tilt), tilt)
        return self.air_ohm + change

    def upright_lift_off_mm(self, impedance_ohm: complex) -> float:
        """Return the lift-off [mm] at which an upright coil changes as much (metal touched: 0)."""
        change = abs(impedance_ohm - self.air_ohm)
        return float(np.interp(-change, -self._sizes, self._knots))

    def _tilt_factor(self, clearance_mm: float, tilt_deg: float) -> complex:
        """Return dZ(tilted) / dZ(upright, same face height)."""
        needed = max(4, int(np.searchsorted(TILTS_DEG, tilt_deg)) + 1)
        if needed > self._tilt_end or self._factor is None:
            self._factor = self._tabulate(needed)
        sine, clearance = np.sin(np.radians(tilt_deg)), min(clearance_mm, CLEARANCES_MM[-1])
        real, imaginary = (float(spline(sine, clearance, grid=False)) for spline in self._factor)
        return complex(real, imaginary)

    def _tabulate(self, needed: int) -> tuple[RectBivariateSpline, RectBivariateSpline]:
        self._tilt_end = needed
        for tilt in TILTS_DEG[:needed]:
            if tilt not in self._rows:
                self._rows[tilt] = tilt_factors(self.coil, self.conductor, self.frequency_hz, tilt)
        rows = np.array([self._rows[t] for t in TILTS_DEG[:needed]])
        sines = np.sin(np.radians(TILTS_DEG[:needed]))
        return (
            RectBivariateSpline(sines, CLEARANCES_MM, rows.real, kx=3, ky=3),
            RectBivariateSpline(sines, CLEARANCES_MM, rows.imag, kx=3, ky=3),
        )


@lru_cache(maxsize=64)
def tilt_factors(coil: Coil, conductor: Conductor, frequency_hz: float, tilt_deg: float) -> ComplexArray:
    """Return dZ(tilted) / dZ(upright at the same face height) at CLEARANCES_MM (C,).

    Both by the same wave numbers up to 45 / outer radius, where the ratio has
    long converged: the cut cancels between them.
    """
    if tilt_deg == 0:
        return np.ones(len(CLEARANCES_MM), dtype=np.complex128)
    step = 3.0 / coil.outer_m
    k, w = gauss_panels(np.concatenate([[0.0], step * 2.0 ** np.arange(-12, 1), step * np.arange(2, 16)]), 8)
    metal = w * reflection(conductor, k, frequency_hz)
    rise_m = 2e-3 * (CLEARANCES_MM + least_lift_off_mm(coil, tilt_deg))
    upright = laplace_sum(k, metal * power_spectrum(coil, k, 0.0), rise_m)
    tilted = laplace_sum(k, metal * power_spectrum(coil, k, tilt_deg), 2e-3 * CLEARANCES_MM)
    return np.asarray(tilted / upright)


def edge_zone_mm(coil: Coil) -> float:
    """Return the distance to an edge [mm] below which a reading is not physics."""
    return EDGE_RADII * coil.outer_radius_mm
