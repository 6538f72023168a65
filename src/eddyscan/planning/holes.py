"""Holes closed for the sake of the field: rows run on behind a hole as if it were not there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path as Outline
from scipy.interpolate import RBFInterpolator
from scipy.spatial import Delaunay, KDTree, QhullError

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import face_vectors, vertex_normals
from eddyscan.planning.smooth import tangents_of
from eddyscan.planning.topology import border_loops

LARGEST_OF_PATCH = 0.5
SUPPORT = 240
LEAST_SUPPORT = 8  # fewer vertices round a hole hold no plate; its cap is flat


@dataclass(frozen=True)
class Filled:
    """A patch with its holes closed.

    Attributes
    ----------
    vertices, normals : (V', 3), faces : (F', 3)
        The patch's own come first, in order; then those of the fillings.
    n_faces : int, of the patch itself
    hole_mm : (V',)
        Distance to the nearest hole's rim, negative inside fillings; inf without holes.
    outer : list of (n,) int64
        Borders that are no holes, longest first.
    n_holes : int
    """

    vertices: Array
    normals: Array
    faces: IntArray
    n_faces: int
    hole_mm: Array
    outer: list[IntArray]
    n_holes: int

    @property
    def edge_mm(self) -> float:
        """Return a typical edge length [mm]."""
        return float(np.sqrt(2.3 * np.median(np.linalg.norm(face_vectors(self.vertices, self.faces), axis=1)) / 2))


def fill_holes(vertices: Array, faces: IntArray, normals: Array) -> Filled:
    """Close every border that a smooth cap can close, except the outer one."""
    loops = sorted(border_loops(faces), key=lambda loop: -_perimeter(vertices[loop]))
    area = 0.5 * float(np.linalg.norm(face_vectors(vertices, faces), axis=1).sum())
    holes = [loop for loop in loops[1:] if _is_hole(vertices, normals, loop, area)]
    outer = [loop for loop in loops if not any(loop is hole for hole in holes)]
    all_vertices, all_faces, done = [vertices], [faces], []
    n = len(vertices)
    for loop in holes:
        cap = _cap(vertices, normals, loop, n)
        if cap is None:
            outer.append(loop)
            continue
        all_vertices.append(cap[0])
        all_faces.append(cap[1])
        n += len(cap[0])
        done.append(loop)
    whole, all_of_it = np.concatenate(all_vertices), np.concatenate(all_faces)
    if done:
        normals = np.concatenate([normals, vertex_normals(whole, all_of_it)[len(vertices) :]])
    distance = _hole_distance(whole, len(vertices), done)
    return Filled(whole, normals, all_of_it, len(faces), distance, outer, len(done))


def _perimeter(points: Array) -> float:
    return float(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum())


def _is_hole(vertices: Array, normals: Array, loop: IntArray, patch_mm2: float) -> bool:
    """Tell a hole from the end of a tube: round a hole the surface faces the way the hole does."""
    points = vertices[loop]
    enclosed = 0.5 * np.cross(points - points.mean(axis=0), np.roll(points, -1, axis=0) - points.mean(axis=0)).sum(0)
    size = float(np.linalg.norm(enclosed))
    if size < 1e-9 or size > LARGEST_OF_PATCH * patch_mm2 or len(loop) < 3:
        return False
    return bool(np.abs(normals[loop] @ (enclosed / size)).mean() > 0.6)


def _cap(vertices: Array, normals: Array, loop: IntArray, first_new: int) -> tuple[Array, IntArray] | None:
    """Return a cap's inner vertices and faces, or None when the loop does not open flat."""
    points = vertices[loop]
    normal = normals[loop].mean(axis=0)
    normal /= max(float(np.linalg.norm(normal)), 1e-9)
    u, v = tangents_of(normal[None])[0]
    centre = points.mean(axis=0)
    rim = np.stack([(points - centre) @ u, (points - centre) @ v], axis=1)
    if _perimeter(rim) < 0.8 * _perimeter(points):
        return None
    inner = _inner_points(rim)
    try:
        triangles = Delaunay(np.concatenate([rim, inner])).simplices
    except QhullError:
        return None
    flat = np.concatenate([rim, inner])
    triangles = triangles[Outline(rim).contains_points(flat[triangles].mean(axis=1))]
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    d, e = b - a, c - a
    flip = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0] < 0
    triangles[flip] = triangles[flip][:, ::-1]
    number = np.concatenate([loop, first_new + np.arange(len(inner))])
    return _raised(vertices, inner, centre, (u, v, normal)), number[triangles].astype(np.int64)


def _inner_points(rim: Array) -> Array:
    edge = _perimeter(rim) / len(rim)
    low, high = rim.min(axis=0), rim.max(axis=0)
    edge = max(edge, float(np.sqrt(np.prod(high - low) / 20_000)))
    x, y = np.meshgrid(np.arange(low[0], high[0], edge), np.arange(low[1], high[1], 0.87 * edge), indexing="ij")
    x = x + 0.5 * edge * (np.arange(x.shape[1]) % 2)
    grid = np.stack([x.ravel(), y.ravel()], axis=1)
    grid = grid[Outline(rim).contains_points(grid)]
    return np.asarray(grid[KDTree(rim).query(grid)[0] > 0.5 * edge]) if len(grid) else grid


def _raised(vertices: Array, inner: Array, centre: Array, frame: tuple[Array, Array, Array]) -> Array:
    """Lift flat points to the thin plate through the surface round the hole."""
    if len(inner) == 0:
        return np.empty((0, 3))
    u, v, n = frame
    reach = 1.6 * float(np.linalg.norm(inner, axis=1).max()) + 1e-9
    near = np.flatnonzero(np.linalg.norm(vertices - centre, axis=1) < reach)
    if len(near) < LEAST_SUPPORT:
        return np.asarray(centre + inner[:, :1] * u + inner[:, 1:] * v)
    near = near[:: max(1, len(near) // SUPPORT)]
    d = vertices[near] - centre
    plate = RBFInterpolator(np.stack([d @ u, d @ v], axis=1), d @ n, smoothing=1e-6)
    return np.asarray(centre + inner[:, :1] * u + inner[:, 1:] * v + plate(inner)[:, None] * n)


def _hole_distance(vertices: Array, n_patch: int, holes: list[IntArray]) -> Array:
    if not holes:
        return np.full(len(vertices), np.inf)
    spots = []
    for loop in holes:
        a, b = vertices[loop], vertices[np.roll(loop, -1)]
        spots += [a + t * (b - a) for t in np.arange(0, 1, 0.125)]
    distance = np.asarray(KDTree(np.concatenate(spots)).query(vertices)[0])
    distance[n_patch:] *= -1
    distance[np.concatenate(holes)] = 0.0
    return distance
