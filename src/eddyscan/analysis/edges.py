"""The rim of the inspected surface, where a coil sees the edge and nothing may be called."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors

EDGE_ZONE_IN_OUTER_RADII = 1.7
CREASE_COSINE = 0.6
SPACING_MM = 0.5


def rim_points(mesh: SurfaceMesh) -> Array:
    """Return points (K, 3) [mm] every 0.5 mm along open edges and sharp creases of the mesh."""
    corner = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    ordered = np.sort(corner, axis=1)
    key = ordered[:, 0] * len(mesh.vertices) + ordered[:, 1]
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    unit = face_vectors(mesh.vertices, mesh.faces)
    unit = unit / np.maximum(np.linalg.norm(unit, axis=1, keepdims=True), 1e-30)
    shared = first[count == 2]
    a, b = face[order[shared]], face[order[shared + 1]]
    sharp = shared[(unit[a] * unit[b]).sum(axis=1) < CREASE_COSINE]
    edges = ordered[order[np.concatenate([first[count == 1], sharp])]]
    return _along(mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]])


def distance_to_rim_mm(mesh: SurfaceMesh, points_mm: Array) -> Array:
    """Return the distance (M,) [mm] to the nearest rim point; infinite for a surface without rim."""
    rim = rim_points(mesh)
    if len(rim) == 0:
        return np.full(len(points_mm), np.inf)
    return np.asarray(KDTree(rim).query(points_mm)[0])


def edge_zone_mm(outer_radius_mm: float) -> float:
    """Return the width of the zone without calls [mm].

    A wall at 1.7 outer radii of the coil changes its reading by 0.01 % of X0,
    from wall-distance computations with the insulating-wall surrogate.
    """
    return EDGE_ZONE_IN_OUTER_RADII * outer_radius_mm


def _along(a: Array, b: Array) -> Array:
    if len(a) == 0:
        return np.empty((0, 3))
    count = int(np.clip(np.ceil(np.linalg.norm(b - a, axis=1).max() / SPACING_MM), 1, 50))
    share = np.linspace(0.0, 1.0, count + 1)[None, :, None]
    return np.asarray((a[:, None] * (1 - share) + b[:, None] * share).reshape(-1, 3))
