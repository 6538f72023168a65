"""Each indication by itself: its picture in the C-scan and its trace in the impedance plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array, BoolArray, ComplexArray
from eddyscan.core.indication import Indication
from eddyscan.report.content import ReportContent
from eddyscan.report.figures_signal import median_ohm
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
    """Draw the signal around an indication, its trace in the impedance plane, and the row through it."""
    assert content.record is not None
    record, part = content.record, content.record.part_mm
    figure, (picture, plane, strip) = canvas(height_in=2.7, columns=3)
    near = neighbourhood(part, indication, content.technique.plan.pitch_mm)
    middle = near & (record.row == record.row[_nearest(part, indication)])
    signal = record.impedance_ohm if content.residual_ohm is None else content.residual_ohm
    signal = 1000 * (signal - median_ohm(signal))
    drawn = picture.scatter(
        part[near, 0], part[near, 1], c=np.abs(signal[near]), s=_marker_size(near), marker="s", lw=0, rasterized=True
    )
    picture.plot(*indication.centre_mm[:2], "+", color=theme.alarm, ms=11, mew=1.3)
    colour_bar(figure, drawn, picture, theme, title="|signal| [mΩ]")
    map_axes(picture, f"Indication {indication.number}: C-scan")
    _trace(content, plane, theme, near=near, middle=middle)
    _strip(part[middle], signal[middle], strip, theme)
    return figure


def _marker_size(near: BoolArray) -> float:
    return float(np.clip(9000.0 / max(int(near.sum()), 1), 4, 130))


def _nearest(positions_mm: Array, indication: Indication) -> int:
    return int(np.linalg.norm(positions_mm - np.asarray(indication.centre_mm), axis=1).argmin())


def lift_off_rotation(impedance_ohm: ComplexArray, lift_off_mm: Array | None) -> complex:
    """Return the unit factor that turns growing lift-off to the left, as analysts read the plane.

    The direction is the regression slope of impedance over lift-off; 1 (no
    rotation) without lift-off values that vary.
    """
    if lift_off_mm is None:
        return 1.0
    known = np.isfinite(lift_off_mm) & np.isfinite(impedance_ohm)
    h = lift_off_mm[known] - (lift_off_mm[known].mean() if known.any() else 0.0)
    slope = complex((impedance_ohm[known] * h).sum())
    return -np.conj(slope) / abs(slope) if abs(slope) > 0 else 1.0


def _trace(content: ReportContent, axes: Axes, theme: Theme, *, near: BoolArray, middle: BoolArray) -> None:
    """Draw the raw readings of the neighbourhood, row by row, in the turned impedance plane."""
    assert content.record is not None
    record = content.record
    turn = lift_off_rotation(record.impedance_ohm, content.lift_off_mm)
    z = turn * record.impedance_ohm
    z = 1000 * (z - median_ohm(z[near]))
    for row in np.unique(record.row[near & ~middle]):
        chosen = near & (record.row == row)
        axes.plot(z.real[chosen], z.imag[chosen], color=theme.muted, lw=0.5, alpha=0.6)
    axes.plot(z.real[middle], z.imag[middle], color=theme.second, lw=1.4)
    axes.set_title("Impedance plane" if turn == 1.0 else f"Impedance plane, turned {np.degrees(np.angle(turn)):.0f}°")
    axes.set_xlabel("resistance change [mΩ]" if turn == 1.0 else "lift-off runs to the left [mΩ]")
    axes.set_ylabel("reactance change [mΩ]" if turn == 1.0 else "across lift-off [mΩ]")
    axes.set_aspect("equal", adjustable="datalim")


def _strip(part_mm: Array, signal_mohm: ComplexArray, axes: Axes, theme: Theme) -> None:
    """Draw both components of the signal along the nearest row."""
    travelled = np.linalg.norm(part_mm - part_mm[:1], axis=1)
    axes.plot(travelled, signal_mohm.real, color=theme.accent, lw=1.2, label="R")
    axes.plot(travelled, signal_mohm.imag, color=theme.second, lw=1.2, label="X")
    axes.set_title("Nearest row")
    axes.set_xlabel("along the row [mm]")
    axes.set_ylabel("change [mΩ]")
    axes.legend(loc="best")
