"""Signals: maps over the part, strips along the path, the impedance plane, the lift-off histogram."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.record import ScanRecord
from eddyscan.report.envelopes import line
from eddyscan.report.figures_plan import point_size
from eddyscan.report.theme import Theme, canvas, colour_bar, map_axes, map_height_in
from eddyscan.report.words import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


CRACK_CHANNELS = ("residual", "score")


def median_ohm(impedance_ohm: ComplexArray) -> complex:
    """Return the median of either component over the readings that have a value; 0 without any."""
    known = impedance_ohm[np.isfinite(impedance_ohm)]
    return complex(np.median(known.real), np.median(known.imag)) if known.size else 0j


def reading_maps(record: ScanRecord, residual_ohm: ComplexArray | None, lift_off_mm: Array | None) -> dict[str, Array]:
    """Return what each reading tells as title with unit -> (N,) values."""
    change_mohm = 1000 * (record.impedance_ohm - median_ohm(record.impedance_ohm))
    maps = {
        "resistance, change from its median [mΩ]": change_mohm.real,
        "reactance, change from its median [mΩ]": change_mohm.imag,
    }
    if lift_off_mm is not None:
        maps["lift-off told by the probe [mm]"] = lift_off_mm
    if residual_ohm is not None:
        maps["residual: crack channel [mΩ]"] = 1000 * np.abs(residual_ohm)
    return maps


def readings_figure(record: ScanRecord, maps: dict[str, Array], theme: Theme) -> Figure:
    """Draw every reading where it was taken, one map per channel, raw."""
    part, rows = record.part_mm, (len(maps) + 1) // 2
    figure, panels = canvas(
        height_in=map_height_in(part, 4.5, extra_in=0.95) * rows, rows=rows, columns=2, squeeze=False
    )
    for panel, (title, values) in zip(panels.flat, maps.items(), strict=False):
        known = np.isfinite(values)
        drawn = panel.scatter(
            part[known, 0],
            part[known, 1],
            c=values[known],
            s=point_size(len(values)),
            marker="s",
            lw=0,
            norm=_scale(title, values),
            cmap=_colours(title),
            rasterized=len(values) > 500,
        )
        colour_bar(figure, drawn, panel, theme)
        map_axes(panel, title)
    for panel in panels.flat[len(maps) :]:
        panel.set_axis_off()
    return figure


def _say(panel: Axes, text: str) -> None:
    """Write in the middle of an empty panel instead of showing bare axes."""
    panel.set_axis_off()
    panel.text(0.5, 0.5, text, ha="center", va="center", transform=panel.transAxes)


def _colours(title: str) -> str:
    return "cividis" if "lift" in title else "viridis"


def _scale(title: str, values: Array) -> Any:
    """Return the colour scale: the crack channels show their whole range, the others what 99 % of readings hold."""
    from matplotlib.colors import Normalize, PowerNorm

    known = values[np.isfinite(values)]
    if known.size == 0:
        return Normalize(0.0, 1.0)
    if any(word in title for word in CRACK_CHANNELS):
        return PowerNorm(0.5, max(float(known.min()), 0.0), max(float(known.max()), 1e-12))
    low, high = np.percentile(known, (0.5, 99.5))
    return Normalize(float(low), max(float(high), float(low) + 1e-12))


def cscan_figure(cscan: CScan, names: list[str], theme: Theme) -> Figure:
    """Draw C-scan channels on the surface, seen from above; nothing where no reading speaks for the spot."""
    rows = (len(names) + 1) // 2
    figure, panels = canvas(
        height_in=map_height_in(cscan.mesh.vertices, 4.5, extra_in=0.95) * rows, rows=rows, columns=2, squeeze=False
    )
    mesh = cscan.mesh
    for panel, name in zip(panels.flat, names, strict=False):
        values = cscan.channels[name]
        known = np.isfinite(values) & cscan.covered
        map_axes(panel, label(name))
        if not known.any():
            _say(panel, "no reading speaks here")
            continue
        faces = mesh.faces[known[mesh.faces].all(axis=1)]
        if len(faces):
            drawn = panel.tripcolor(
                mesh.vertices[:, 0],
                mesh.vertices[:, 1],
                faces,
                np.where(known, values, 0.0),
                shading="gouraud",
                norm=_scale(name, values[known]),
                cmap=_colours(name),
                rasterized=True,
            )
            colour_bar(figure, drawn, panel, theme)
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
    colour_bar(figure, drawn, axes, theme, title="reading" if lift_off_mm is None else "lift-off [mm]")
    axes.set_xlabel("resistance [Ω]")
    axes.set_ylabel("reactance [Ω]")
    axes.set_title("Impedance plane, as read")
    return figure


def lift_off_figure(lift_off_mm: Array, coarse_mm: Array | None, target_mm: float, theme: Theme) -> Figure:
    """Draw how the actual lift-off is spread about the technique's value, before and after correction."""
    figure, axes = canvas(height_in=3.4, width_in=4.4)
    known = lift_off_mm[np.isfinite(lift_off_mm)]
    before = np.zeros(0) if coarse_mm is None else coarse_mm[np.isfinite(coarse_mm)]
    bins = np.histogram_bin_edges(np.concatenate([known, before]), bins=60)
    if before.size:
        share = len(known) / len(before)
        weights = np.full(before.size, share)
        axes.hist(before, bins=bins, weights=weights, color=theme.muted, alpha=0.55, lw=0, label="coarse pass, scaled")
    axes.hist(known, bins=bins, color=theme.accent, lw=0, label="corrected pass" if before.size else None)
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
        line(panel, record.time_s, values, colour=theme.second, width=0.7)
        panel.set_ylabel(title)
    panels[0].set_title("Strip chart, as read")
    panels[-1].set_xlabel("time since the scan began [s]")
    return figure
