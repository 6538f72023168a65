"""A regular mesh inside a true outline: border vertices lie on the outline itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array, IntArray
from eddyscan.surface.nearest import nearest_with_distance

SNAP_SHARE = 0.35  # an inner vertex this near the outline (in cells) moves onto it


def inside_polygon(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Return which of (N, 2) points lie inside a closed polygon (M, 2), by the even-odd rule."""
    inside = np.zeros(len(points), dtype=bool)
    following = np.roll(polygon, -1, axis=0)
    x, y = points[:, 0], points[:, 1]
    for (ax, ay), (bx, by) in zip(polygon, following, strict=True):
        crosses = (ay > y) != (by > y)
        if by != ay:
            inside ^= crosses & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return inside


def boundary_samples(polygon: Array, spacing_mm: float) -> Array:
    """Return points on the polygon's sides at most `spacing_mm` apart, its corners among them."""
    pieces = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / spacing_mm)))
        pieces.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def mesh_inside(polygon: Array, grid_mm: float) -> tuple[Array, IntArray]:
    """Triangulate the inside of an outline.

    Parameters
    ----------
    polygon : (M, 2) [mm]
    grid_mm : float
        Edge length of the grid; divided so that the bounding box holds whole cells.

    Returns
    -------
    xy : (V, 2) [mm]
    faces : (F, 3) counter-clockwise
    """
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    n = np.maximum(np.round((high - low) / grid_mm).astype(int), 1)
    x, y = (np.linspace(low[k], high[k], n[k] + 1) for k in range(2))
    X, Y = np.meshgrid(x, y, indexing="ij")
    xy = np.stack([X.ravel(), Y.ravel()], axis=1)
    border = boundary_samples(polygon, 0.05)
    distance, nearest = nearest_with_distance(border, xy)
    inner = inside_polygon(xy, polygon) & (distance > SNAP_SHARE * grid_mm)
    on = ~inner & (distance <= SNAP_SHARE * grid_mm)
    faces = _grid_triangles(n[0] + 1, n[1] + 1)
    touched = np.zeros(len(xy), dtype=bool)
    touched[faces[inner[faces].any(axis=1)].ravel()] = True
    on |= touched & ~inner
    xy = np.where(on[:, None], border[nearest], xy)
    faces = faces[(inner | on)[faces].all(axis=1)]
    return _compact(xy, _proper(xy, faces, grid_mm, polygon))


def _grid_triangles(nx: int, ny: int) -> IntArray:
    """Return both triangles of every cell; diagonals alternate so that no direction is favoured."""
    index = np.arange(nx * ny).reshape(nx, ny)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    even = (np.add.outer(np.arange(nx - 1), np.arange(ny - 1)) % 2 == 0)[..., None]
    first = np.where(even, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(even, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def _proper(xy: Array, faces: IntArray, grid_mm: float, polygon: Array) -> IntArray:
    """Drop triangles that snapping has flattened, turned over or pushed outside."""
    a, b, c = (xy[faces[:, k]] for k in range(3))
    area = 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    faces = faces[area > 1e-3 * grid_mm**2]
    return faces[inside_polygon(xy[faces].mean(axis=1), polygon)]


def _compact(xy: Array, faces: IntArray) -> tuple[Array, IntArray]:
    used, flat = np.unique(faces, return_inverse=True)
    return xy[used], flat.reshape(-1, 3).astype(np.int64)


def without_vertices(faces: IntArray, drop: NDArray[np.bool_]) -> tuple[NDArray[np.int64], IntArray]:
    """Return the kept vertices' indices and the faces among them after dropping some vertices."""
    kept = faces[~drop[faces].any(axis=1)]
    used, flat = np.unique(kept, return_inverse=True)
    return used, flat.reshape(-1, 3).astype(np.int64)
