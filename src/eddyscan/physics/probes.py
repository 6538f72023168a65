"""Two coils: differential and transmit-receive probes, on sound metal and over a slot.

The coils stand upright side by side with their faces at one height. Both use
what one coil uses: the reflection of the stack, and the slot's one matrix inverse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j0

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, MU0, Coil, source, wave_numbers, winding_integral
from eddyscan.physics.conductor import Conductor, reflection
from eddyscan.physics.impedance import laplace_sum
from eddyscan.physics.slot_solver import SlotSolver


@dataclass(frozen=True)
class CoilPair:
    """Two coils side by side.

    Attributes
    ----------
    first, second : Coil
        Transmit-receive: `first` drives, `second` listens. Differential: two arms
        of a bridge, which reads first minus second.
    distance_mm : between the axes
    angle_deg : direction from the first to the second axis, from the x axis of the
        frame in which positions are given

    Raises
    ------
    TechniqueError
        Windings that would overlap.
    """

    first: Coil
    second: Coil
    distance_mm: float
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        least = self.first.outer_radius_mm + self.second.outer_radius_mm
        if not self.distance_mm >= least:
            raise TechniqueError(
                f"distance_mm = {self.distance_mm:g}: must be at least {least:g} mm, the sum of the outer radii; "
                "nearer, the windings overlap."
            )

    @property
    def offset_mm(self) -> tuple[float, float]:
        """Second axis minus first axis (x, y) [mm]."""
        angle = np.radians(self.angle_deg)
        return float(self.distance_mm * np.cos(angle)), float(self.distance_mm * np.sin(angle))


def mutual_impedance_ohm(
    pair: CoilPair, conductor: Conductor, frequency_hz: float, lift_off_mm: ArrayLike
) -> ComplexArray:
    """Return the transfer impedance of a pair over sound metal, voltage of one per ampere in the other (...) [ohm].

    j omega M with M in air pi mu0 i1 i2 integral of R1 R2 F(k) J0(k s) dk, F the double
    integral of exp(-k |z - z'|) over both lengths, plus what the metal reflects,
    j omega pi mu0 i1 i2 integral of M1 M2 exp(-2 k h) Gamma J0(k s) dk.
    """
    checks.positive("frequency_hz", frequency_hz, unit="Hz")
    lift_off = np.asarray(lift_off_mm, dtype=np.float64)
    checks.lift_offs(lift_off)
    one, two, s = pair.first, pair.second, pair.distance_mm * MM
    k, w = wave_numbers(min(one, two, key=lambda coil: coil.mean_radius_m), reach_m=2 * s + one.outer_m + two.outer_m)
    scale = 2j * np.pi * frequency_hz * np.pi * MU0 * one.turn_density * two.turn_density
    a, b = k * one.length_m, k * two.length_m
    lengths = (2 * np.minimum(a, b) - 1 + np.exp(-a) + np.exp(-b) - np.exp(-np.abs(a - b))) / k**2
    air = np.sum(w * winding_integral(one, k) * winding_integral(two, k) * lengths * j0(k * s))
    spectrum = w * source(one, k) * source(two, k) * reflection(conductor, k, frequency_hz) * j0(k * s)
    return np.asarray(scale * (air + laplace_sum(k, spectrum, 2 * lift_off * MM)))


def transmit_receive_change_ohm(
    solver: SlotSolver, pair: CoilPair, *, x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike
) -> ComplexArray:
    """Return the slot's change of transfer impedance (N,) or (N, H) [ohm]; x, y is the middle between the axes."""
    dx, dy = pair.offset_mm
    x, y = np.asarray(x_mm, dtype=np.float64) - 0.5 * dx, np.asarray(y_mm, dtype=np.float64) - 0.5 * dy
    return solver.transfer_ohm(pair.first, pair.second, (dx, dy), x_mm=x, y_mm=y, lift_off_mm=lift_off_mm)


def differential_change_ohm(
    solver: SlotSolver, pair: CoilPair, *, x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike
) -> ComplexArray:
    """Return dZ of the first coil minus dZ of the second (N,) or (N, H) [ohm]; x, y is the middle between the axes."""
    dx, dy = pair.offset_mm
    x, y = np.asarray(x_mm, dtype=np.float64), np.asarray(y_mm, dtype=np.float64)
    first = solver.change_ohm(pair.first, x - 0.5 * dx, y - 0.5 * dy, lift_off_mm)
    second = solver.change_ohm(pair.second, x + 0.5 * dx, y + 0.5 * dy, lift_off_mm)
    return first - second
