"""The rim of the inspected surface: open edges and sharp creases of its mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors

EDGE_ZONE_IN_OUTER_RADII = 1.7
CREASE_COSINE = 0.6
SPACING_MM = 0.5


@dataclass(frozen=True)
class Rim:
    """Points every 0.5 mm along the rim.

    Attributes
    ----------
    points_mm : (K, 3) [mm, frame of the mesh]
    inward : (K, 3) unit, in the surface, square to the rim, away from the edge
    normal : (K, 3) unit outward normals of the surface at the rim
    """

    points_mm: Array
    inward: Array
    normal: Array

    def distance_mm(self, points_mm: Array) -> Array:
        """Return the distance (M,) [mm] to the nearest rim point; infinite without a rim."""
        if len(self.points_mm) == 0:
            return np.full(len(points_mm), np.inf)
        return np.asarray(KDTree(self.points_mm).query(points_mm)[0])


def rim_of(mesh: SurfaceMesh) -> Rim:
    """Return the rim of a mesh; at a crease the upper of the two faces is the inspected one."""
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
    sharp = (unit[a] * unit[b]).sum(axis=1) < CREASE_COSINE
    upper = np.where(unit[a, 2] >= unit[b, 2], a, b)[sharp]
    owner = np.concatenate([face[order[first[count == 1]]], upper])
    edges = ordered[order[np.concatenate([first[count == 1], shared[sharp]])]]
    return _sampled(mesh, edges, owner, unit)


def edge_zone_mm(outer_radius_mm: float) -> float:
    """Return the width of the zone without calls [mm].

    A wall at 1.7 outer radii of the coil changes its reading by 0.01 % of X0
    (insulating wall as a stand-in for the edge).
    """
    return EDGE_ZONE_IN_OUTER_RADII * outer_radius_mm


def _sampled(mesh: SurfaceMesh, edges: Array, owner: Array, unit: Array) -> Rim:
    a, b = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]]
    length = np.linalg.norm(b - a, axis=1)
    good = length > 1e-9
    a, b, owner, length = a[good], b[good], owner[good], length[good]
    along = (b - a) / length[:, None]
    inward = mesh.vertices[mesh.faces[owner]].mean(axis=1) - a
    inward = inward - (inward * along).sum(axis=1, keepdims=True) * along
    inward = inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-30)
    pieces = np.maximum(np.ceil(length / SPACING_MM).astype(np.int64), 1)
    edge = np.repeat(np.arange(len(a)), pieces)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    share = ((step + 0.5) / pieces[edge])[:, None]
    return Rim(a[edge] * (1 - share) + b[edge] * share, inward[edge], unit[owner][edge])
