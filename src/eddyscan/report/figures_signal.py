"""Signals: maps over the part, strips along the path, the impedance plane, the lift-off histogram."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.record import ScanRecord
from eddyscan.report.figures_plan import point_size
from eddyscan.report.theme import Theme, canvas, colour_bar, map_axes
from eddyscan.report.words import label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def reading_maps(record: ScanRecord, residual_ohm: ComplexArray | None, lift_off_mm: Array | None) -> dict[str, Array]:
    """Return what each reading tells as title with unit -> (N,) values."""
    z = record.impedance_ohm
    maps = {
        "resistance, change from its median [mΩ]": 1000 * (z.real - np.nanmedian(z.real)),
        "reactance, change from its median [mΩ]": 1000 * (z.imag - np.nanmedian(z.imag)),
    }
    if lift_off_mm is not None:
        maps["lift-off told by the probe [mm]"] = lift_off_mm
    if residual_ohm is not None:
        maps["residual: crack channel [mΩ]"] = 1000 * np.abs(residual_ohm)
    return maps


def readings_figure(record: ScanRecord, maps: dict[str, Array], theme: Theme) -> Figure:
    """Draw every reading where it was taken, one map per channel, raw."""
    figure, panels = canvas(height_in=2.5 * ((len(maps) + 1) // 2), rows=(len(maps) + 1) // 2, columns=2, squeeze=False)
    part = record.part_mm
    for panel, (title, values) in zip(panels.flat, maps.items(), strict=False):
        known = np.isfinite(values)
        low, high = np.percentile(values[known], (0.5, 99.5)) if known.any() else (0.0, 1.0)
        drawn = panel.scatter(
            part[known, 0],
            part[known, 1],
            c=values[known],
            s=point_size(len(values)),
            marker="s",
            lw=0,
            vmin=low,
            vmax=max(high, low + 1e-12),
            cmap=_colours(title),
            rasterized=len(values) > 500,
        )
        colour_bar(figure, drawn, panel, "", theme)
        map_axes(panel, title)
    for panel in panels.flat[len(maps) :]:
        panel.set_axis_off()
    return figure


def _colours(title: str) -> str:
    return "cividis" if "lift" in title else "viridis"


def cscan_figure(cscan: CScan, names: list[str], theme: Theme) -> Figure:
    """Draw C-scan channels on the surface, seen from above; nothing where no reading speaks for the spot."""
    rows = (len(names) + 1) // 2
    figure, panels = canvas(height_in=2.5 * rows, rows=rows, columns=2, squeeze=False)
    mesh = cscan.mesh
    for panel, name in zip(panels.flat, names, strict=False):
        values = cscan.channels[name]
        known = np.isfinite(values) & cscan.covered
        faces = mesh.faces[known[mesh.faces].all(axis=1)]
        if len(faces):
            low, high = np.percentile(values[known], (0.5, 99.5))
            drawn = panel.tripcolor(
                mesh.vertices[:, 0],
                mesh.vertices[:, 1],
                faces,
                np.where(known, values, low),
                shading="gouraud",
                vmin=low,
                vmax=max(high, low + 1e-12),
                cmap=_colours(name),
                rasterized=True,
            )
            colour_bar(figure, drawn, panel, "", theme)
        map_axes(panel, label(name))
    for panel in panels.flat[len(names) :]:
        panel.set_axis_off()
    return figure


def plane_figure(record: ScanRecord, lift_off_mm: Array | None, theme: Theme) -> Figure:
    """Draw the impedance plane, raw and unrotated."""
    figure, axes = canvas(height_in=3.4, width_in=4.4)
    z = record.impedance_ohm
    known = np.isfinite(z)
    colour = np.arange(len(z)) if lift_off_mm is None else lift_off_mm
    drawn = axes.scatter(
        z.real[known], z.imag[known], c=colour[known], s=5, cmap="cividis", lw=0, rasterized=len(z) > 500
    )
    colour_bar(figure, drawn, axes, "reading" if lift_off_mm is None else "lift-off [mm]", theme)
    axes.set_xlabel("resistance [Ω]")
    axes.set_ylabel("reactance [Ω]")
    axes.set_title("Impedance plane, as read")
    return figure


def lift_off_figure(lift_off_mm: Array, target_mm: float, theme: Theme) -> Figure:
    """Draw how the actual lift-off is spread about the technique's value."""
    figure, axes = canvas(height_in=3.4, width_in=4.4)
    known = lift_off_mm[np.isfinite(lift_off_mm)]
    axes.hist(known, bins=50, color=theme.accent, lw=0)
    axes.axvline(target_mm, color=theme.second, lw=1.4, label=f"technique: {target_mm:g} mm")
    axes.set_xlabel("lift-off told by the probe [mm]")
    axes.set_ylabel("readings")
    axes.set_title("Lift-off histogram")
    axes.legend(loc="best")
    return figure


def strip_figure(record: ScanRecord, residual_ohm: ComplexArray | None, theme: Theme) -> Figure:
    """Draw resistance, reactance and the residual over time."""
    z = record.impedance_ohm
    strips = {"R [Ω]": z.real, "X [Ω]": z.imag}
    if residual_ohm is not None:
        strips["residual [mΩ]"] = 1000 * np.abs(residual_ohm)
    figure, panels = canvas(height_in=0.7 + 1.1 * len(strips), rows=len(strips), sharex=True)
    for panel, (title, values) in zip(panels, strips.items(), strict=True):
        panel.plot(record.time_s, values, color=theme.second, lw=0.7, rasterized=len(values) > 3000)
        panel.set_ylabel(title)
    panels[0].set_title("Strip chart, as read")
    panels[-1].set_xlabel("time since the scan began [s]")
    return figure
