"""TEAM Workshop Problem 15: the measured signal of a slot in an aluminium plate, as a benchmark.

Measurements: S. K. Burke, "A benchmark problem for computation of delta-Z in
eddy-current nondestructive evaluation", J. Nondestr. Eval. 7 (1988) 35,
published as TEAM Workshop Problem 15. The table's transcription and its credit
stand at the head of the CSV file beside this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics.coil import Coil
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.slot import Slot

PLATE = Conductor.plate(30.6, 12.22)
SLOT = Slot(length_mm=12.6, depth_mm=5.0, opening_mm=0.28)


@dataclass(frozen=True)
class Experiment:
    """One of the two problems: coil, frequency and lift-off over the same slot."""

    coil: Coil
    frequency_hz: float
    lift_off_mm: float
    measured_air_h: float


PROBLEM_1 = Experiment(Coil(6.15, 12.4, 6.15, 3790), 900.0, 0.88, 0.2218)
PROBLEM_2 = Experiment(Coil(9.34, 18.4, 9.0, 408), 7000.0, 2.03, 3.96e-3)


@dataclass(frozen=True)
class Agreement:
    """Model against measurement.

    Attributes
    ----------
    rms : RMS of the complex difference over the measured peak |dZ|
    peak_ratio : model peak |dZ| over measured peak |dZ|
    phase_deg : largest |phase difference| where |dZ| exceeds 20 % of the peak
    """

    rms: float
    peak_ratio: float
    phase_deg: float


def measured_problem_1() -> tuple[Array, ComplexArray]:
    """Return the 44 measured positions x (44,) [mm] along the slot and dZ (44,) [ohm]."""
    text = files("eddyscan.physics").joinpath("benchmarks/team15_problem1.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines() if line[:1].isdigit()]
    table = np.array([[float(value) for value in row] for row in rows])
    return table[:, 1], table[:, 3] + 2j * np.pi * PROBLEM_1.frequency_hz * table[:, 2] * 1e-6


def agreement(model_ohm: ComplexArray, measured_ohm: ComplexArray) -> Agreement:
    """Compare dZ (N,) [ohm] of the model with the measured one."""
    peak = float(np.abs(measured_ohm).max())
    strong = np.abs(measured_ohm) > 0.2 * peak
    phase = np.degrees(np.angle(model_ohm[strong] / measured_ohm[strong]))
    rms = float(np.sqrt(np.mean(np.abs(model_ohm - measured_ohm) ** 2))) / peak
    return Agreement(rms, float(np.abs(model_ohm).max()) / peak, float(np.abs(phase).max()))
