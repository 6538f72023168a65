"""The study's ways to lay rows: a field on the mesh and the levels that become rows."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array, BoolArray
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.topology import Edges

# Rings run level round a slope, so all of a ring may be stretched; planes only touch theirs.
STEEPEST_PLANE, STEEPEST_RING = 4.0, 20.0
# Rows may lie this much further apart when that saves one.
STRETCH = 0.0005


def spread_levels(
    at: Array, along: Array, pitch_mm: float, span_mm: tuple[float, float], *, steepest: float = STEEPEST_PLANE
) -> Array:
    """Return positions of planes or rings whose rows are at most a pitch apart on the surface.

    Parameters
    ----------
    at : (V,) [mm], position of each vertex across the rows
    along : (V,) part of its normal in the direction across the rows
    pitch_mm : float, distance between rows on the surface
    span_mm : least and largest position of the region
    steepest : float, largest factor by which the surface is longer than the positions are apart

    Notes
    -----
    Along the steepest way between two planes the surface is 1 / sqrt(1 - n_a^2)
    as long as the planes are apart (n_a: the normal's part across them). Nine
    tenths of every row keep the pitch.
    """
    if at.size == 0:
        return np.empty(0)
    stretch = np.minimum(1 / np.sqrt(np.maximum(1 - along**2, 1e-6)), steepest)
    low, high = span_mm
    edges = np.linspace(low, high, max(2, int(np.ceil((high - low) / min(1.0, pitch_mm / 2)))) + 1)
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


def ring_field(surface: SmoothSurface, inside: BoolArray) -> tuple[Array, Array]:
    """Return distances from the vertical axis through the region's middle, and normals' parts that way (V,)."""
    xy = surface.vertices[inside, :2]
    out = surface.vertices[:, :2] - (xy.min(axis=0) + xy.max(axis=0)) / 2
    distance = np.linalg.norm(out, axis=1)
    return distance, np.einsum("vk,vk->v", surface.normals[:, :2], out / np.maximum(distance, 1e-9)[:, None])


def span_inside(field: Array, guard: Array, edges: Edges) -> tuple[float, float]:
    """Return the least and largest value of a vertex field where the guard is positive, exact at its rim."""
    a, b = edges.ends.T
    cut = (guard[a] > 0) != (guard[b] > 0)
    t = guard[a][cut] / (guard[a][cut] - guard[b][cut])
    values = np.concatenate([field[guard > 0], field[a][cut] + t * (field[b][cut] - field[a][cut])])
    return float(values.min()), float(values.max())
