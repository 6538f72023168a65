"""Where the stage was asked to go and where it says it was: the reference study's figures 20 and 21."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import IntArray
from eddyscan.core.record import ScanRecord
from eddyscan.report.envelopes import sparse
from eddyscan.report.theme import Theme, canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES = ("x", "y", "z")
MOST_MARKS, MOST_ROWS = 1500, 25


@dataclass(frozen=True)
class AxisError:
    """Recorded minus planned position of one axis [um]."""

    axis: str
    mean_um: float
    std_um: float
    largest_um: float
    readings: int


def axis_errors(record: ScanRecord) -> tuple[AxisError, ...]:
    """Return mean, standard deviation and largest error per axis over the readings that have a position."""
    errors = []
    for k, axis in enumerate(AXES):
        error = 1000 * (record.stage_mm[:, k] - record.target_mm[:, k])
        error = error[np.isfinite(error)]
        if error.size:
            errors.append(
                AxisError(axis, float(error.mean()), float(error.std()), float(np.abs(error).max()), error.size)
            )
    return tuple(errors)


def longest_row(record: ScanRecord) -> int:
    """Return the row with the most readings."""
    rows, counts = np.unique(record.row, return_counts=True)
    return int(rows[counts.argmax()])


def position_figure(record: ScanRecord, theme: Theme) -> Figure:
    """Draw planned and recorded positions of one row in x and z, and of the whole scan in x and y."""
    figure, (side, above) = canvas(height_in=3.0, columns=2)
    row = longest_row(record)
    every = np.arange(len(record))
    shown, step = _evenly_chosen_rows(record)
    for axes, chosen, (i, j) in ((side, every[record.row == row], (0, 2)), (above, shown, (0, 1))):
        planned, recorded = record.target_mm[chosen], record.stage_mm[chosen]
        axes.plot(planned[:, i], planned[:, j], "o", mfc="none", mec=theme.accent, ms=4.5, mew=0.9, label="planned")
        axes.plot(recorded[:, i], recorded[:, j], ".", color=theme.second, ms=2.6, label="recorded")
        axes.set_xlabel(f"{AXES[i]} stage [mm]")
        axes.set_ylabel(f"{AXES[j]} stage [mm]")
    side.set_title(f"Row {row}: x and z")
    above.set_title("Whole scan: x and y" if step == 1 else f"x and y, 1 of {step} rows")
    side.legend(loc="best")
    return figure


def _evenly_chosen_rows(record: ScanRecord) -> tuple[IntArray, int]:
    """Return the readings of every k-th row, few enough to be seen as points, and k."""
    every = np.arange(len(record))
    if len(record) <= MOST_MARKS:
        return every, 1
    rows = np.unique(record.row)
    step = -(-len(rows) // MOST_ROWS)
    chosen = every[np.isin(record.row, rows[::step])]
    return chosen[sparse(len(chosen), MOST_MARKS)], step


def error_figure(record: ScanRecord, theme: Theme) -> Figure:
    """Draw how the position errors of each axis are spread."""
    figure, axes = canvas(height_in=2.3, columns=3)
    for panel, error in zip(axes, axis_errors(record), strict=False):
        values = 1000 * (record.stage_mm - record.target_mm)[:, AXES.index(error.axis)]
        panel.hist(values[np.isfinite(values)], bins=40, color=theme.accent, lw=0)
        panel.axvline(error.mean_um, color=theme.second, lw=1.2)
        panel.set_title(f"{error.axis}: {error.mean_um:+.2f} ± {error.std_um:.2f} µm".replace("-", "−"))
        panel.set_xlabel("recorded − planned [µm]")
    axes[0].set_ylabel("readings")
    return figure
