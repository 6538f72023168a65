"""The plan: its rows over the part, predicted lift-off and tilt, and what is left out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import ScanPlan
from eddyscan.report.envelopes import MOST_POINTS, sparse
from eddyscan.report.theme import Theme, canvas, colour_bar, map_axes, map_height_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def path_figure(plan: ScanPlan, mesh: SurfaceMesh | None, theme: Theme) -> Figure:
    """Draw the path from above: rows, links, start and end, and the uncovered spots."""
    figure, axes = canvas(height_in=map_height_in(plan.surface_mm, 9.0, extra_in=1.35))
    if mesh is not None:
        _contours(axes, mesh, theme)
    spots = plan.surface_mm
    scan = plan.is_scan
    few = spots[sparse(len(spots))]
    axes.plot(
        few[:, 0],
        few[:, 1],
        color=theme.muted,
        lw=0.5,
        ls=":",
        label="links and approaches",
    )
    drawn = axes.scatter(
        spots[scan, 0],
        spots[scan, 1],
        c=np.arange(plan.n_scan),
        s=point_size(plan.n_scan),
        cmap="viridis",
        label=f"{plan.n_scan} readings in {plan.n_rows} rows",
        rasterized=plan.n_scan > 2000,
        lw=0,
    )
    first, last = spots[scan][0], spots[scan][-1]
    axes.annotate("start", first[:2], (-6, 5), textcoords="offset points", color=theme.ink, fontsize=8.5, ha="right")
    axes.annotate("end", last[:2], (6, 5), textcoords="offset points", color=theme.ink, fontsize=8.5)
    _mark_uncovered(axes, plan, theme)
    colour_bar(figure, drawn, axes, theme, title="visiting order")
    map_axes(axes, "The path from above")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3)
    return figure


def _contours(axes: Axes, mesh: SurfaceMesh, theme: Theme) -> None:
    """Draw the surface's form as lines of equal height, behind everything else."""
    x, y, z = mesh.vertices.T
    if float(np.ptp(z)) > 0.1:
        axes.tricontour(x, y, mesh.faces, z, levels=10, colors=theme.muted, linewidths=0.5, alpha=0.55, zorder=0.5)


def _mark_uncovered(axes: Axes, plan: ScanPlan, theme: Theme) -> None:
    spots = [spot for spot in plan.coverage.uncovered if spot.centre_mm is not None]
    for number, spot in enumerate(spots):
        assert spot.centre_mm is not None
        axes.plot(
            *spot.centre_mm[:2],
            marker="x",
            color=theme.alarm,
            ms=7,
            mew=1.6,
            ls="none",
            label="left out" if number == 0 else "_",
        )


def point_size(points: int) -> float:
    """Return a marker area that fills a map of `points` readings without hiding the rows."""
    return float(np.clip(9000 / max(points, 1), 1.5, 14))


def predicted_figure(plan: ScanPlan, target_mm: float, theme: Theme) -> Figure:
    """Draw predicted lift-off and tilt: of every reading, or of every row when there are many."""
    figure, (lift, tilt) = canvas(height_in=3.9, rows=2, sharex=True)
    scan = plan.is_scan
    by_row = plan.n_scan > MOST_POINTS
    for axes, values in ((lift, plan.lift_off_mm[scan]), (tilt, plan.tilt_deg[scan])):
        if by_row:
            _rows(axes, plan.row[scan], values, theme)
        else:
            axes.plot(np.arange(plan.n_scan), values, color=theme.second, lw=1)
            for k in np.flatnonzero(np.diff(plan.row[scan])):
                axes.axvline(k + 0.5, color=theme.rule, lw=0.5, zorder=0)
        axes.grid(axis="x", visible=False)
    lift.axhline(target_mm, color=theme.accent, lw=1, ls="--", label=f"asked for: {target_mm:g} mm")
    lift.set_ylabel("lift-off [mm]")
    what = "row (band: least to largest, line: mean)" if by_row else "reading (vertical lines part the rows)"
    lift.set_title(f"Predicted lift-off and tilt of every {what}")
    lift.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)
    tilt.set_ylabel("tilt [°]")
    tilt.set_xlabel("row" if by_row else "reading, in visiting order")
    tilt.set_ylim(bottom=0)
    return figure


def _rows(axes: Axes, row: IntArray, values: Array, theme: Theme) -> None:
    """Draw least, mean and largest value of every row."""
    order = np.argsort(row, kind="stable")
    rows, starts, counts = np.unique(row[order], return_index=True, return_counts=True)
    low, high = np.minimum.reduceat(values[order], starts), np.maximum.reduceat(values[order], starts)
    axes.fill_between(rows, low, high, color=theme.second, alpha=0.25, lw=0)
    axes.plot(rows, np.add.reduceat(values[order], starts) / counts, color=theme.second, lw=1.2)
