"""Choosing an operating point: one case over a range of frequencies or lift-offs."""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.progress import Progress, silent
from eddyscan.physics.case import SignalCase, case_slot
from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor, skin_depth_mm
from eddyscan.physics.impedance import impedance_change_ohm
from eddyscan.physics.slot_solver import SlotSolver

Over = Literal["frequency", "lift-off"]
FREQUENCY_SPAN = 10.0
FREQUENCIES = 13
LIFT_OFFS = 16
SLOPE_STEP = 1e-4


def sweep_case(case: SignalCase, over: str, *, progress: Progress = silent) -> dict[str, Any]:
    """Return one row per frequency (a tenth to ten times the case's) or lift-off (0 to two outer radii).

    Each row holds the value swept, the skin depth, the sound signal, the lift-off
    slope in % of X0 per 0.1 mm, and - with a slot - its largest signal over the
    case's positions in % of X0, the lift-off change that reads as much [um], and the
    angle between slot and lift-off signal [deg, 0 to 90], which says how well a
    rotated display parts them.

    Raises
    ------
    TechniqueError
        `over` is not "frequency" or "lift-off".
    """
    if over not in get_args(Over):
        raise TechniqueError(f"sweep = {over!r}: must be one of {', '.join(get_args(Over))}.")
    rows = _over_frequency(case, progress) if over == "frequency" else _over_lift_off(case)
    return {"sweep": rows, "over": over}


def _over_frequency(case: SignalCase, progress: Progress) -> list[dict[str, float]]:
    centre = case.drive.frequency_hz
    frequencies = np.geomspace(centre / FREQUENCY_SPAN, min(centre * FREQUENCY_SPAN, 20e6), FREQUENCIES)
    rows = []
    for number, frequency in enumerate(frequencies, start=1):
        rows += _rows(case, float(frequency), np.array([case.scan.lift_off_mm]))
        progress("frequency sweep", number, len(frequencies))
    return rows


def _over_lift_off(case: SignalCase) -> list[dict[str, float]]:
    heights = 2 * case.coil.outer_radius_mm * np.linspace(0.0, 1.0, LIFT_OFFS) ** 1.5
    return _rows(case, case.drive.frequency_hz, heights)


def _rows(case: SignalCase, frequency_hz: float, lift_off_mm: Array) -> list[dict[str, float]]:
    coil, conductor = case.physical_coil, case.physical_conductor
    omega = 2 * np.pi * frequency_hz
    air_h = air_inductance_h(coil)
    change = impedance_change_ohm(coil, conductor, frequency_hz, lift_off_mm)
    slope = _slope_ohm_mm(coil, conductor, frequency_hz, lift_off_mm)
    peak = _slot_peak_ohm(case, coil, conductor, frequency_hz, lift_off_mm)
    metal = case.conductor
    rows = []
    for number, height in enumerate(lift_off_mm):
        row = {
            "frequency_hz": frequency_hz,
            "lift_off_mm": float(height),
            "skin_depth_mm": skin_depth_mm(metal.conductivity_ms_m, frequency_hz, metal.relative_permeability),
            "resistance_ohm": float(change[number].real),
            "inductance_h": float(air_h + change[number].imag / omega),
            "lift_off_percent_per_100um": float(10 * abs(slope[number]) / (omega * air_h)),
        }
        if peak is not None:
            turn = abs(float(np.degrees(np.angle(peak[number] / slope[number]))))
            row |= {
                "slot_percent": float(100 * abs(peak[number]) / (omega * air_h)),
                "slot_as_lift_off_um": float(1e3 * abs(peak[number]) / abs(slope[number])),
                "slot_angle_deg": min(turn, 180.0 - turn),
            }
        rows.append(row)
    return rows


def _slope_ohm_mm(coil: Coil, conductor: Conductor, frequency_hz: float, lift_off_mm: Array) -> ComplexArray:
    """Return dZ/dh by a one-sided second-order difference, good from lift-off 0 on."""
    step = SLOPE_STEP * coil.outer_radius_mm
    z = [impedance_change_ohm(coil, conductor, frequency_hz, lift_off_mm + n * step) for n in range(3)]
    return np.asarray((-3 * z[0] + 4 * z[1] - z[2]) / (2 * step))


def _slot_peak_ohm(
    case: SignalCase, coil: Coil, conductor: Conductor, frequency_hz: float, lift_off_mm: Array
) -> ComplexArray | None:
    """Return the strongest slot signal over the case's positions, per lift-off (H,); None without a slot."""
    slot = case_slot(case)
    if slot is None:
        return None
    detail = 0.5 * (coil.inner_radius_mm + coil.outer_radius_mm)
    x_mm, y_mm = case.scan.positions_mm
    signals = SlotSolver(slot, conductor, frequency_hz, detail_mm=detail).change_ohm(coil, x_mm, y_mm, lift_off_mm)
    return np.asarray(signals[np.abs(signals).argmax(axis=0), np.arange(len(lift_off_mm))])
