"""The surface against its nominal: the profile of the reference study's figure 12, and the map of deviations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array, IntArray, apply
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.report.content import NominalComparison
from eddyscan.report.theme import Theme, canvas, colour_bar, map_axes, map_height_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BINS = 100
SAME_HEIGHT_MM, MIDDLE_SHARE = 0.5, 0.06


@dataclass(frozen=True)
class Profile:
    """Heights along x in strips that hold a vertex: (K,) arrays in mm.

    The spread is the standard deviation across y of what the nominal (or, without
    one, the mean line) leaves over, so a slope does not count as spread. `how`
    says in words what was averaged.
    """

    x_mm: Array
    measured_mm: Array
    spread_mm: Array
    nominal_mm: Array
    how: str


def profile(mesh: SurfaceMesh, nominal: NominalComparison | None) -> Profile:
    """Average z in strips along x, measured and nominal at the very same spots.

    A part that keeps its height across y (a block) is averaged over all of y, as in
    the study; one that does not (a dome, a blade) over a band about its middle.
    """
    points = mesh.vertices if nominal is None else apply(nominal.T_nominal_mesh, mesh.vertices)
    points, expected = _with_nominal_height(points, nominal)
    how = "averaged over y"
    if len(points) and _height_across_y_mm(points) > SAME_HEIGHT_MM:
        low, high = points[:, 1].min(), points[:, 1].max()
        middle, half = (low + high) / 2, MIDDLE_SHARE * (high - low)
        near = np.abs(points[:, 1] - middle) <= half
        points, expected = points[near], expected[near]
        how = f"averaged over the middle, y {middle - half:.1f} to {middle + half:.1f} mm"
    if len(points) == 0:
        nothing = np.array([np.nan])
        return Profile(nothing, nothing, nothing, nothing, how)
    strip = _strips(points)
    x_mm, z_mm, nominal_mm = (_mean(values, strip) for values in (points[:, 0], points[:, 2], expected))
    along = expected
    if nominal is None:
        slope = np.gradient(z_mm, x_mm) if len(x_mm) > 1 else np.zeros(1)
        along = z_mm[strip] + slope[strip] * (points[:, 0] - x_mm[strip])
    off = points[:, 2] - along
    spread = np.sqrt(_mean((off - _mean(off, strip)[strip]) ** 2, strip))
    return Profile(x_mm, z_mm, spread, nominal_mm, how)


def _with_nominal_height(points: Array, nominal: NominalComparison | None) -> tuple[Array, Array]:
    """Return the points that have a nominal height, and it; without a nominal all of them, and NaN."""
    if nominal is None:
        return points, np.full(len(points), np.nan)
    expected = heights(nominal.surface, points[:, :2])
    known = np.isfinite(expected)
    return points[known], expected[known]


def _strips(points: Array) -> IntArray:
    """Return the number of the strip along x of each point, without gaps from 0."""
    edges = np.linspace(points[:, 0].min(), points[:, 0].max() + 1e-9, BINS + 1)
    _, strip = np.unique(np.digitize(points[:, 0], edges), return_inverse=True)
    return np.asarray(strip, dtype=np.int64)


def _height_across_y_mm(points: Array) -> float:
    """Return how much z varies across y, slope along x taken out: median over the strips [mm]."""
    strip = _strips(points)
    mean_x, mean_z = _mean(points[:, 0], strip), _mean(points[:, 2], strip)
    slope = np.gradient(mean_z, mean_x) if len(mean_x) > 1 else np.zeros(1)
    off = points[:, 2] - mean_z[strip] - slope[strip] * (points[:, 0] - mean_x[strip])
    return float(np.median(np.sqrt(_mean(off**2, strip))))


def _mean(values: Array, group: IntArray) -> Array:
    """Return the mean of each group (K,); groups are numbered 0 to K - 1 without gaps."""
    return np.asarray(np.bincount(group, values) / np.bincount(group))


def heights(surface: SurfaceMesh, xy_mm: Array) -> Array:
    """Return the upper height of a mesh at (N, 2) spots [mm]; NaN beside it."""
    from scipy.interpolate import LinearNDInterpolator

    upward = surface.vertices[surface.normals[:, 2] > 0.02]
    if len(upward) < 4:
        return np.full(len(xy_mm), np.nan)
    return np.asarray(LinearNDInterpolator(upward[:, :2], upward[:, 2])(xy_mm), dtype=np.float64)


def profile_figure(mesh: SurfaceMesh, nominal: NominalComparison | None, theme: Theme) -> Figure:
    """Draw z along x, averaged over y, and below it the difference to the nominal."""
    line = profile(mesh, nominal)
    rows = 1 if nominal is None else 2
    ratios = None if nominal is None else [2, 1]
    figure, axes = canvas(height_in=1.6 + 1.5 * rows, rows=rows, sharex=True, height_ratios=ratios, squeeze=False)
    top = axes[0, 0]
    top.fill_between(
        line.x_mm,
        line.measured_mm - line.spread_mm,
        line.measured_mm + line.spread_mm,
        color=theme.second,
        alpha=0.18,
        lw=0,
    )
    if nominal is not None:
        top.plot(line.x_mm, line.nominal_mm, color=theme.accent, lw=2.2, label=f"nominal {nominal.name}")
    top.plot(line.x_mm, line.measured_mm, color=theme.second, lw=1.1, label="measured (band: ± 1 std)")
    top.set_ylabel("z [mm]")
    top.set_title(f"Height along x, {line.how}")
    top.legend(loc="best")
    if nominal is not None:
        below = axes[1, 0]
        below.axhline(0, color=theme.accent, lw=1.2)
        below.plot(line.x_mm, 1000 * (line.measured_mm - line.nominal_mm), color=theme.second, lw=1.2)
        below.set_ylabel("difference [µm]")
    axes[-1, 0].set_xlabel("x [mm]")
    return figure


def deviation_figure(mesh: SurfaceMesh, signed_mm: Array, theme: Theme) -> Figure:
    """Draw the signed distance to the nominal over the part, and how it is spread."""
    figure, (plan, spread) = canvas(height_in=3.1, columns=2, width_ratios=[2.4, 1])
    known = np.isfinite(signed_mm)
    limit = max(float(np.percentile(np.abs(signed_mm[known]), 99)), 1e-6) if known.any() else 1.0
    faces = mesh.faces[known[mesh.faces].all(axis=1)]
    if len(faces):
        drawn = plan.tripcolor(
            mesh.vertices[:, 0],
            mesh.vertices[:, 1],
            faces,
            np.where(known, 1000 * signed_mm, 0.0),
            cmap="RdBu_r",
            vmin=-1000 * limit,
            vmax=1000 * limit,
            shading="gouraud",
            rasterized=True,
        )
        colour_bar(figure, drawn, plan, theme, title="outside + / inside − [µm]")
    map_axes(plan, "Distance to the nominal along the normal")
    spread.hist(1000 * np.clip(signed_mm[known], -limit, limit), bins=60, color=theme.accent, lw=0)
    spread.axvline(0, color=theme.second, lw=1)
    spread.set_title("Distribution")
    spread.set_xlabel("distance [µm]")
    spread.set_ylabel("vertices")
    return figure


def uncertainty_figure(mesh: SurfaceMesh, theme: Theme) -> Figure:
    """Draw the stated standard uncertainty of the surface over the part."""
    assert mesh.uncertainty_mm is not None
    figure, plan = canvas(height_in=map_height_in(mesh.vertices, 4.4, extra_in=0.95), width_in=4.4)
    drawn = plan.tripcolor(
        mesh.vertices[:, 0],
        mesh.vertices[:, 1],
        mesh.faces,
        1000 * mesh.uncertainty_mm,
        vmax=1000 * float(np.nanpercentile(mesh.uncertainty_mm, 99)),
        cmap="cividis",
        shading="gouraud",
        rasterized=True,
    )
    colour_bar(figure, drawn, plan, theme, title="standard uncertainty [µm]")
    map_axes(plan, "Stated uncertainty along the normal")
    return figure
