"""Pictures of a signal case: impedance plane, along the scan, and sweeps. Matplotlib is imported late."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.physics.case import SignalCase, slot_signal_ohm
from eddyscan.physics.coil import air_inductance_h
from eddyscan.physics.impedance import impedance_change_ohm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def case_figure(case: SignalCase) -> Figure:
    """Draw the normalised impedance plane and, with a slot, its signal along the scan.

    Left: R/X0 against X/X0, the lift-off line from the case's lift-off to air and
    the slot's loop on it. Right: dR and dX in ohms against the position. Raw,
    unrotated.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    signal = slot_signal_ohm(case)
    coil, frequency = case.physical_coil, case.drive.frequency_hz
    x0 = 2 * np.pi * frequency * air_inductance_h(coil)
    heights = np.concatenate([[0.0], np.geomspace(0.01, 20, 200)]) * coil.outer_radius_mm + case.scan.lift_off_mm
    line = 1j + impedance_change_ohm(coil, case.physical_conductor, frequency, heights) / x0
    left.plot(line.real, line.imag, color="0.55", label="lift-off line to air")
    left.plot([0], [1], "k+", markersize=9, label="air")
    left.plot(line[0].real, line[0].imag, "ko", markersize=5, label=f"sound, lift-off {case.scan.lift_off_mm:g} mm")
    left.set(xlabel="R / X0", ylabel="X / X0", title=f"Impedance plane at {frequency:g} Hz, X0 = {x0:.4g} ohm")
    if case.slot is not None:
        _slot_loop(left, signal / x0, line[0])
        _along(right, case, signal)
    else:
        right.plot(heights, (line.real), label="R / X0")
        right.plot(heights, (line.imag), label="X / X0")
        right.set(xlabel="lift-off [mm]", xlim=(0, 4 * coil.outer_radius_mm), title="Sound conductor")
        right.legend()
    left.legend()
    return figure


def _slot_loop(axes: Axes, signal: np.ndarray, sound: complex) -> None:
    """Draw the slot's loop in an inset: it is small against the whole plane."""
    inset = axes.inset_axes((0.55, 0.1, 0.42, 0.42))
    inset.plot(100 * signal.real, 100 * signal.imag, color="tab:red", marker=".", markersize=3, linewidth=1)
    inset.plot([0], [0], "ko", markersize=4)
    inset.set(xlabel="dR / X0 [%]", ylabel="dX / X0 [%]", title="slot")
    inset.tick_params(labelsize=7)
    total = sound + signal
    axes.plot(total.real, total.imag, color="tab:red", linewidth=1, label="slot")


def _along(axes: Axes, case: SignalCase, signal: np.ndarray) -> None:
    x_mm, y_mm = case.scan.positions_mm
    along_x = np.ptp(x_mm) >= np.ptp(y_mm)
    place = x_mm if along_x else y_mm
    axes.plot(place, signal.real, marker=".", label="dR")
    axes.plot(place, signal.imag, marker=".", label="dX")
    axes.plot(place, np.abs(signal), color="0.6", linewidth=1, label="|dZ|")
    if along_x and case.slot is not None:
        axes.axvspan(-0.5 * case.slot.length_mm, 0.5 * case.slot.length_mm, color="0.93")
    axes.axhline(0, color="0.8", linewidth=0.8)
    axes.set(xlabel="x along the slot [mm]" if along_x else "y across the slot [mm]", ylabel="ohm", title="Slot signal")
    axes.legend()


def sweep_figure(sweep: dict[str, Any]) -> Figure:
    """Draw a sweep from `sweep_case`: slot and lift-off signal, and the angle between them."""
    from matplotlib.figure import Figure

    rows = sweep["sweep"]
    if not rows:
        raise TechniqueError("the sweep holds 0 rows: nothing to draw.")
    key, label = ("frequency_hz", "frequency [Hz]")
    if sweep["over"] == "lift-off":
        key, label = ("lift_off_mm", "lift-off [mm]")
    place = [row[key] for row in rows]
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(place, [row["lift_off_percent_per_100um"] for row in rows], label="lift-off, per 0.1 mm")
    if "slot_percent" in rows[0]:
        left.plot(place, [row["slot_percent"] for row in rows], label="slot")
        right.plot(place, [row["slot_angle_deg"] for row in rows], color="tab:red")
        right.set(xlabel=label, ylabel="angle between slot and lift-off [deg]", title="How well they part")
    else:
        right.plot(place, [row["skin_depth_mm"] for row in rows], color="tab:red")
        right.set(xlabel=label, ylabel="mm", title="Skin depth")
    left.set(xlabel=label, ylabel="% of X0", title="Signals")
    left.legend()
    if sweep["over"] == "frequency":
        left.set_xscale("log")
        right.set_xscale("log")
    return figure
