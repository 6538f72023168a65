"""Pictures of the physics section of docs/validation.md."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.physics_references import FINITE_ELEMENTS
from benchmarks.validation_page import PICTURES
from eddyscan.core.frames import Array
from eddyscan.physics import Coil, Conductor, Slot, SlotSolver, air_inductance_h, impedance_change_ohm, slot_change_ohm
from eddyscan.physics.team15 import PLATE, PROBLEM_1, SLOT, measured_problem_1

PENCIL = Coil(0.5, 1.5, 1.0, 100)
DPI = 90


def write_figures() -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, figure in (
        ("team15-1", team15_figure()),
        ("slot-map", map_figure()),
        ("impedance-plane", plane_figure()),
    ):
        figure.savefig(PICTURES / f"physics-{name}.png", dpi=DPI)


def team15_figure() -> Figure:
    x_mm, measured = measured_problem_1()
    fine = np.linspace(0, 23, 93)
    omega = 2 * np.pi * PROBLEM_1.frequency_hz
    model = slot_change_ohm(
        SLOT, PROBLEM_1.coil, PLATE, PROBLEM_1.frequency_hz, x_mm=fine, y_mm=0.0, lift_off_mm=PROBLEM_1.lift_off_mm
    )
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.errorbar(x_mm, 1e6 * measured.imag / omega, 40, fmt="k.", label="measured (Burke 1988)", capsize=2)
    left.plot(fine, 1e6 * model.imag / omega, color="tab:red", label="this model")
    left.plot(FINITE_ELEMENTS[:, 0], FINITE_ELEMENTS[:, 1], "b+", label="published finite elements")
    left.set(xlabel="coil position along the slot [mm]", ylabel="dL [uH]", title="TEAM 15 problem 1, 900 Hz")
    right.errorbar(x_mm, measured.real, 0.1, fmt="k.", capsize=2)
    right.plot(fine, model.real, color="tab:red")
    right.plot(FINITE_ELEMENTS[:, 0], FINITE_ELEMENTS[:, 2], "b+")
    right.set(xlabel="coil position along the slot [mm]", ylabel="dR [ohm]")
    left.legend(fontsize=8, loc="upper right")
    return figure


def map_figure() -> Figure:
    figure = Figure(figsize=(11, 3.9), layout="constrained")
    axes = figure.subplots(1, 3)
    x, y = np.linspace(-4, 4, 81), np.linspace(-3, 3, 61)
    grid_x, grid_y = np.meshgrid(x, y)
    x0 = 2 * np.pi * 5e5 * air_inductance_h(PENCIL)
    for panel, slot in zip(
        axes, (Slot(3, 1, 0.02), Slot(3, 1, 0.02, "semi-elliptic"), Slot(1, 0.5, 0.02)), strict=True
    ):
        solver = SlotSolver(slot, Conductor.half_space(19.0), 5e5, detail_mm=1.0)
        size = 100 * np.abs(solver.change_ohm(PENCIL, grid_x.ravel(), grid_y.ravel(), 0.1)) / x0
        picture = panel.pcolormesh(x, y, size.reshape(grid_x.shape), cmap="viridis", shading="gouraud")
        panel.plot([-slot.length_mm / 2, slot.length_mm / 2], [0, 0], "w-", linewidth=1.5)
        panel.set(
            xlabel="x [mm]",
            title=f"{slot.length_mm:g} x {slot.depth_mm:g} mm {slot.profile}, opening {slot.opening_mm:g} mm",
            aspect="equal",
        )
        panel.title.set_fontsize(9)
        figure.colorbar(picture, ax=panel, label="|dZ| / X0 [%]", shrink=0.8)
    axes[0].set_ylabel("y [mm]")
    return figure


def plane_figure() -> Figure:
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    heights = np.linspace(0, 3, 120)
    x0 = 2 * np.pi * 5e5 * air_inductance_h(PENCIL)
    for name, sigma in (("copper 58 MS/m", 58.0), ("aluminium alloy 19", 19.0), ("Ti-6Al-4V 0.58", 0.58)):
        line = 1j + impedance_change_ohm(PENCIL, Conductor.half_space(sigma), 5e5, heights) / x0
        left.plot(line.real, line.imag, label=name)
    sigma_line = [
        1j + complex(impedance_change_ohm(PENCIL, Conductor.half_space(s), 5e5, 0.1)) / x0
        for s in np.geomspace(0.3, 60, 40)
    ]
    left.plot(np.real(sigma_line), np.imag(sigma_line), "k--", linewidth=0.8, label="conductivity at 0.1 mm")
    left.set(xlabel="R / X0", ylabel="X / X0", title="Lift-off lines 0 to 3 mm, 500 kHz, 3 mm pencil coil")
    left.legend(fontsize=8)
    frequencies = np.geomspace(5e4, 5e6, 13)
    for slot, color in ((Slot(3, 1, 0.02), "tab:red"), (Slot(1, 0.3, 0.02), "tab:blue")):
        right.semilogx(
            frequencies, slot_shares(slot, frequencies), color=color, label=f"{slot.length_mm:g} x {slot.depth_mm:g} mm"
        )
    right.set(xlabel="frequency [Hz]", ylabel="largest |dZ| / X0 [%]", title="Slots in aluminium at 0.1 mm lift-off")
    right.legend()
    return figure


def slot_shares(slot: Slot, frequencies_hz: Array) -> list[float]:
    """Return the largest slot signal along the slot [% of X0] at each frequency."""
    shares = []
    for frequency in frequencies_hz:
        solver = SlotSolver(slot, Conductor.half_space(19.0), float(frequency), detail_mm=1.0)
        peak = np.abs(solver.change_ohm(PENCIL, np.linspace(0, 3, 25), 0.0, 0.1)).max()
        shares.append(float(100 * peak / (2 * np.pi * frequency * air_inductance_h(PENCIL))))
    return shares
