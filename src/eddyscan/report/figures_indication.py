"""Each indication by itself: its picture in the C-scan and its trace in the impedance plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.indication import Indication
from eddyscan.report.content import ReportContent
from eddyscan.report.theme import Theme, canvas, colour_bar, map_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SURROUNDINGS_MM = 4.0


def neighbourhood(positions_mm: Array, indication: Indication, pitch_mm: float) -> BoolArray:
    """Return which readings (N,) lie around an indication: its extent, and sound metal beside it."""
    radius = max(SURROUNDINGS_MM, 1.2 * indication.extent_mm, 3 * pitch_mm)
    return np.asarray(np.linalg.norm(positions_mm - np.asarray(indication.centre_mm), axis=1) <= radius)


def indication_figure(content: ReportContent, indication: Indication, theme: Theme) -> Figure:
    """Draw the residual around an indication, its trace in the impedance plane, and the row through it."""
    assert content.record is not None
    record = content.record
    figure, (picture, plane, strip) = canvas(height_in=2.7, columns=3)
    near = neighbourhood(record.part_mm, indication, content.technique.plan.pitch_mm)
    signal = record.impedance_ohm if content.residual_ohm is None else content.residual_ohm
    signal = 1000 * (signal - (np.nanmedian(signal.real) + 1j * np.nanmedian(signal.imag)))
    part = record.part_mm
    spread = 1500.0 / max(int(near.sum()), 1)
    drawn = picture.scatter(
        part[near, 0],
        part[near, 1],
        c=np.abs(signal[near]),
        s=np.clip(spread, 4, 90),
        marker="s",
        lw=0,
        rasterized=True,
    )
    picture.plot(*indication.centre_mm[:2], "+", color=theme.alarm, ms=11, mew=1.3)
    colour_bar(figure, drawn, picture, "|signal| [mΩ]", theme)
    map_axes(picture, "C-scan around it")
    _trace(content, indication, near, plane, theme)
    row = record.row == record.row[_nearest(part, indication)]
    along = part[row & near]
    travelled = np.linalg.norm(along - along[0], axis=1) if len(along) else np.zeros(0)
    strip.plot(travelled, signal.real[row & near], color=theme.accent, lw=1.2, label="R")
    strip.plot(travelled, signal.imag[row & near], color=theme.second, lw=1.2, label="X")
    strip.set_title("Nearest row")
    strip.set_xlabel("along the row [mm]")
    strip.set_ylabel("change [mΩ]")
    strip.legend(loc="best")
    return figure


def _nearest(positions_mm: Array, indication: Indication) -> int:
    return int(np.linalg.norm(positions_mm - np.asarray(indication.centre_mm), axis=1).argmin())


def _trace(content: ReportContent, indication: Indication, near: BoolArray, axes: Axes, theme: Theme) -> None:
    """Draw the raw readings of the neighbourhood, row by row, in the impedance plane."""
    assert content.record is not None
    record = content.record
    z = 1000 * (record.impedance_ohm - np.nanmedian(record.impedance_ohm[near]) if near.any() else record.impedance_ohm)
    middle = record.row[_nearest(record.part_mm, indication)]
    for row in np.unique(record.row[near]):
        chosen = near & (record.row == row)
        mid = row == middle
        axes.plot(
            z.real[chosen],
            z.imag[chosen],
            "-",
            color=theme.second if mid else theme.muted,
            lw=1.4 if mid else 0.5,
            alpha=1.0 if mid else 0.6,
        )
    axes.set_title("Impedance plane")
    axes.set_xlabel("resistance change [mΩ]")
    axes.set_ylabel("reactance change [mΩ]")
