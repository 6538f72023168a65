"""The study's ways to lay rows: a field on the mesh and the levels that become rows."""

from __future__ import annotations

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, BoolArray
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.topology import Edges

STEEPEST = 4.0
# Rows may lie this much further apart when that saves one.
STRETCH = 0.0005


def plane_levels(
    surface: SmoothSurface, axis: int, pitch_mm: float, inside: BoolArray, span_mm: tuple[float, float]
) -> Array:
    """Return plane positions along an axis whose rows are at most a pitch apart on the surface.

    Parameters
    ----------
    surface : SmoothSurface
    axis : 0, 1 or 2
    pitch_mm : float, distance between rows on the surface
    inside : (V,) bool, vertices the rows are laid for
    span_mm : least and largest position of the region

    Notes
    -----
    Along the steepest way between two planes the surface is 1 / sqrt(1 - n_a^2)
    as long as the planes are apart (n_a: the normal's part along the axis).
    Nine tenths of every row keep the pitch; where the surface runs along the
    planes the factor is held at 4.
    """
    at = surface.vertices[inside, axis]
    if at.size == 0:
        return np.empty(0)
    stretch = np.minimum(1 / np.sqrt(np.maximum(1 - surface.normals[inside, axis] ** 2, 1e-6)), STEEPEST)
    low, high = span_mm
    edges = np.linspace(low, high, max(2, int(np.ceil((high - low) / min(2.0, pitch_mm)))) + 1)
    cell = np.clip(np.searchsorted(edges, at, side="right") - 1, 0, len(edges) - 2)
    order = np.lexsort((stretch, cell))
    last = np.searchsorted(cell[order], np.arange(len(edges) - 1), side="right") - 1
    n = np.bincount(cell, minlength=len(edges) - 1)
    worst = stretch[order][np.maximum(last - n // 10, 0)]
    worst[n == 0] = 1.0
    length = np.concatenate([[0.0], np.cumsum(worst * np.diff(edges))])
    return np.asarray(np.interp(even_levels(0.0, float(length[-1]), pitch_mm), length, edges))


def even_levels(low: float, high: float, pitch_mm: float) -> Array:
    """Return level values an equal pitch (or a little less) apart, half a pitch inside both ends."""
    n = max(1, int(np.ceil((high - low) / (pitch_mm * (1 + STRETCH)))))
    return low + (np.arange(n) + 0.5) * (high - low) / n


def ring_field(surface: SmoothSurface, inside: BoolArray) -> Array:
    """Return each vertex's distance (V,) [mm] from the vertical axis through the middle of the region."""
    if not inside.any():
        raise GeometryError("the margin leaves nothing to encircle. Lower the margin.")
    xy = surface.vertices[inside, :2]
    centre = (xy.min(axis=0) + xy.max(axis=0)) / 2
    return np.asarray(np.linalg.norm(surface.vertices[:, :2] - centre, axis=1))


def span_inside(field: Array, guard: Array, edges: Edges) -> tuple[float, float]:
    """Return the least and largest value of a vertex field where the guard is positive, exact at its rim."""
    a, b = edges.ends.T
    cut = (guard[a] > 0) != (guard[b] > 0)
    t = guard[a][cut] / (guard[a][cut] - guard[b][cut])
    values = np.concatenate([field[guard > 0], field[a][cut] + t * (field[b][cut] - field[a][cut])])
    return float(values.min()), float(values.max())
