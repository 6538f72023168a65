"""The part seen from above: a height map, and where a vertical tip touches it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import map_coordinates

from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.technique import Probe

MAX_CELLS = 4_000_000
NOTHING = -1e6


@dataclass(frozen=True)
class HeightMap:
    """The highest surface over a regular grid.

    Attributes
    ----------
    z_mm : (Nx, Ny), -1e6 where there is nothing
    x0_mm, y0_mm, cell_mm : float
    """

    z_mm: Array
    x0_mm: float
    y0_mm: float
    cell_mm: float

    def at(self, x_mm: Array, y_mm: Array) -> Array:
        """Return the surface's height at (N,) positions, interpolated; -1e6 beside the part."""
        i, j = (x_mm - self.x0_mm) / self.cell_mm, (y_mm - self.y0_mm) / self.cell_mm
        z = map_coordinates(self.z_mm, np.stack([i, j]), order=1, mode="constant", cval=NOTHING)
        # A cell at the rim mixes surface and nothing: take the higher corner there.
        rim = (z < NOTHING / 1000) & (z > NOTHING * 0.999)
        if rim.any():
            z[rim] = self._highest_corner(i[rim], j[rim])
        return np.asarray(z)

    def _highest_corner(self, i: Array, j: Array) -> Array:
        a, b = np.floor(i).astype(int), np.floor(j).astype(int)
        nx, ny = self.z_mm.shape
        corners = [self.z_mm[np.clip(a + k, 0, nx - 1), np.clip(b + m, 0, ny - 1)] for k in (0, 1) for m in (0, 1)]
        return np.asarray(np.max(corners, axis=0))


def height_map(vertices: Array, faces: IntArray, cell_mm: float) -> HeightMap:
    """Return the height map of a mesh; triangles are sampled finer than the cells they fall in."""
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    cell = max(cell_mm, float(np.sqrt(np.prod(high - low + 2 * cell_mm) / MAX_CELLS)))
    shape = np.ceil((high - low) / cell).astype(int) + 3
    x0, y0 = low - cell
    grid = np.full(shape[0] * shape[1], NOTHING)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    box_low = np.ceil((np.minimum(np.minimum(a, b), c)[:, :2] - (x0, y0)) / cell - 1e-9).astype(int)
    box_high = np.floor((np.maximum(np.maximum(a, b), c)[:, :2] - (x0, y0)) / cell + 1e-9).astype(int)
    size = np.maximum(box_high - box_low + 1, 0)
    for chunk in _chunks(size[:, 0] * size[:, 1]):
        face, i, j = _pixels(box_low[chunk], size[chunk])
        p = np.stack([x0 + i * cell, y0 + j * cell], axis=1)
        z, hit = _height_in(a[chunk][face], b[chunk][face], c[chunk][face], p)
        np.maximum.at(grid, i[hit] * shape[1] + j[hit], z[hit])
    return HeightMap(grid.reshape(shape), float(x0), float(y0), float(cell))


def _chunks(pixels: IntArray, budget: int = 2_000_000) -> list[slice]:
    done = np.cumsum(pixels)
    cuts = [0, *np.unique(np.searchsorted(done, np.arange(budget, done[-1], budget)) + 1).tolist(), len(pixels)]
    return [slice(lo, hi) for lo, hi in pairwise(cuts) if hi > lo]


def _pixels(low: IntArray, size: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    n = size[:, 0] * size[:, 1]
    face = np.repeat(np.arange(len(n)), n)
    k = np.arange(len(face)) - np.repeat(np.cumsum(n) - n, n)
    return face, low[face, 0] + k // size[face, 1], low[face, 1] + k % size[face, 1]


def _height_in(a: Array, b: Array, c: Array, p: Array) -> tuple[Array, BoolArray]:
    e, f, d = b - a, c - a, p - a[:, :2]
    det = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    safe = np.where(np.abs(det) < 1e-12, 1.0, det)
    u = (d[:, 0] * f[:, 1] - d[:, 1] * f[:, 0]) / safe
    v = (e[:, 0] * d[:, 1] - e[:, 1] * d[:, 0]) / safe
    hit = (np.abs(det) >= 1e-12) & (u > -1e-6) & (v > -1e-6) & (u + v < 1 + 1e-6)
    return a[:, 2] + u * e[:, 2] + v * f[:, 2], hit


@dataclass(frozen=True)
class TipShape:
    """A vertical probe as heights above its coil face over offsets from its axis.

    Attributes
    ----------
    offset_mm : (K, 2), height_mm : (K,)
    """

    offset_mm: Array
    height_mm: Array


def tip_shape(probe: Probe) -> TipShape:
    """Return the probe's underside: the coil's face, the tip (flat or ball), its stem and the body's shoulder.

    A coil wider than a ball tip's apex stands out of the ball: its rim is what touches on a slope.
    """
    R = max(probe.tip_radius_mm, probe.outer_radius_mm)
    rings = [np.zeros((1, 2))]
    for radius in np.linspace(0, R, 7)[1:]:
        rings.append(_ring(radius, 8 if radius < 0.5 * R else 24))
    tip = np.concatenate(rings)
    r2 = np.minimum((tip**2).sum(axis=1), R * R)
    ball = R - np.sqrt(R * R - r2)
    height = np.where((probe.tip == "flat") | (r2 <= probe.outer_radius_mm**2), 0.0, ball)
    if probe.body_radius_mm <= R:
        return TipShape(tip, height)
    shoulder = np.concatenate([_ring(r, 24) for r in np.linspace(R, probe.body_radius_mm, 4)[1:]])
    base = (R if probe.tip == "ball" else 0.0) + probe.stem_length_mm
    return TipShape(np.concatenate([tip, shoulder]), np.concatenate([height, np.full(len(shoulder), base)]))


def _ring(radius: float, n: int) -> Array:
    angle = np.arange(n) * 2 * np.pi / n
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def overlap_mm(heights: HeightMap, shape: TipShape, face_mm: Array, *, chunk: int = 200_000) -> Array:
    """Return how far (N,) [mm] a vertical probe with its coil face at (N, 3) reaches into the part.

    Positive: it must rise by that; negative: air left below it.
    """
    worst = np.full(len(face_mm), -np.inf)
    for k in range(0, len(face_mm), chunk):
        part = face_mm[k : k + chunk]
        for (dx, dy), h in zip(shape.offset_mm, shape.height_mm, strict=True):
            z = heights.at(part[:, 0] + dx, part[:, 1] + dy)
            worst[k : k + chunk] = np.maximum(worst[k : k + chunk], z - part[:, 2] - h)
    return worst
