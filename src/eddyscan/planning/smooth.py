"""A smooth surface through a mesh: local quadrics over the probe's footprint.

Every vertex gets a weighted least-squares quadric over its neighbours
(moving least squares, Levin 1998, with biweights). A point inside
a triangle blends the quadrics of its corners, so positions, normals and
curvature come from the smooth fit at that very point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import face_vectors, vertex_normals
from eddyscan.planning.topology import border_edges

NORMAL_TARGET_DEG = 0.4
WIDEST_OF_LEAST = 2.4
AT_BORDERS = 1.35
WIDEST_MM = 10.0
MAX_NEIGHBOURS = 140
CHUNK = 4096


@dataclass(frozen=True)
class SmoothSurface:
    """A mesh whose vertices lie on their own local fits.

    Attributes
    ----------
    vertices : (V, 3) [mm], faces : (F, 3), normals : (V, 3) unit, outward
    tangents : (V, 2, 3) orthonormal directions in each vertex's tangent plane
    quadric : (V, 3)
        (h_uu, h_uv, h_vv) [1/mm]: height over the tangent plane is
        h = (h_uu u^2 + 2 h_uv u v + h_vv v^2) / 2.
    noise_mm : float, residual of the mesh against the fits (one sigma)
    radius_mm : float, of the fits
    """

    vertices: Array
    faces: IntArray
    normals: Array
    tangents: Array
    quadric: Array
    noise_mm: float
    radius_mm: float

    def at(self, points: Array, face: IntArray) -> tuple[Array, Array]:
        """Return the smooth points (N, 3) and normals (N, 3) at flat points (N, 3) inside faces (N,)."""
        weight = self.barycentric(points, face)
        where, normal = np.zeros_like(points), np.zeros_like(points)
        for corner in range(3):
            vertex = self.faces[face, corner]
            P, n = self.lifted(points, vertex)
            where += weight[:, corner, None] * P
            normal += weight[:, corner, None] * n
        return where, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def lifted(self, points: Array, vertex: IntArray) -> tuple[Array, Array]:
        """Return points (N, 3) lifted onto the fits of vertices (N,), and the fits' normals there."""
        x, t, n = self.vertices[vertex], self.tangents[vertex], self.normals[vertex]
        q = self.quadric[vertex]
        d = points - x
        u, v = np.einsum("nk,nk->n", d, t[:, 0]), np.einsum("nk,nk->n", d, t[:, 1])
        h_u, h_v = q[:, 0] * u + q[:, 1] * v, q[:, 1] * u + q[:, 2] * v
        h = 0.5 * (h_u * u + h_v * v)
        lifted = x + u[:, None] * t[:, 0] + v[:, None] * t[:, 1] + h[:, None] * n
        tilted = n - h_u[:, None] * t[:, 0] - h_v[:, None] * t[:, 1]
        return lifted, tilted / np.linalg.norm(tilted, axis=1, keepdims=True)

    def barycentric(self, points: Array, face: IntArray) -> Array:
        """Return the weights (N, 3) of the face's corners at each point, clipped to the triangle."""
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        n = np.cross(b - a, c - a)
        square = np.maximum(np.einsum("nk,nk->n", n, n), 1e-300)
        w_b = np.einsum("nk,nk->n", np.cross(points - a, c - a), n) / square
        w_c = np.einsum("nk,nk->n", np.cross(b - a, points - a), n) / square
        weight = np.clip(np.stack([1 - w_b - w_c, w_b, w_c], axis=1), 0.0, 1.0)
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))

    @property
    def curvature_per_mm(self) -> Array:
        """Return the larger principal curvature (V,) [1/mm], always positive."""
        half, rest = (self.quadric[:, 0] + self.quadric[:, 2]) / 2, (self.quadric[:, 0] - self.quadric[:, 2]) / 2
        spread = np.hypot(rest, self.quadric[:, 1])
        return np.asarray(np.maximum(np.abs(half + spread), np.abs(half - spread)))


def smoothed(vertices: Array, faces: IntArray, footprint_mm: float, *, spacing_mm: float = 0.0) -> SmoothSurface:
    """Fit the smooth surface of a mesh.

    Parameters
    ----------
    vertices : (V, 3) [mm], faces : (F, 3)
    footprint_mm : float
        Width the probe sees: the least diameter of the fits. It grows with the
        mesh's noise until normals are good to about 0.4 degrees, and again near
        borders, where neighbours are on one side only.
    spacing_mm : float
        Distance of the vertices that were measured or drawn, when others were
        added between them: fits span several.
    """
    area = 0.5 * np.linalg.norm(face_vectors(vertices, faces), axis=1).sum()
    density = len(vertices) / max(area, 1e-12)
    narrow = min(footprint_mm, WIDEST_MM) / 2
    least = max(narrow, 2.4 / np.sqrt(density), min(2.4 * spacing_mm, 1.5 * narrow))
    cloud = _Cloud(vertices, vertex_normals(vertices, faces), KDTree(vertices), density)
    sample = np.linspace(0, len(vertices) - 1, min(len(vertices), 600)).astype(np.int64)
    noise_mm = float(np.median(_fit(cloud, sample, least)[4]))
    # Slope error of a biweight quadric in a disc: 1.75 sigma / (sqrt(density) r^2), per direction.
    wanted = np.sqrt(1.25 * 1.75 * noise_mm / (np.radians(NORMAL_TARGET_DEG) * np.sqrt(density)))
    radius = float(np.clip(wanted, least, WIDEST_OF_LEAST * least))
    columns = [np.empty((len(vertices), *shape)) for shape in ((3,), (3,), (2, 3), (3,))]
    for group, reach in _groups(vertices, faces, radius, one_sided=wanted > least):
        for k in range(0, len(group), CHUNK):
            which = group[k : k + CHUNK]
            for column, values in zip(columns, _fit(cloud, which, reach), strict=False):
                column[which] = values
    fitted, normals, tangents, quadric = columns
    return SmoothSurface(fitted, faces, normals, tangents, quadric, noise_mm, radius)


def _groups(vertices: Array, faces: IntArray, radius: float, *, one_sided: bool) -> list[tuple[IntArray, float]]:
    border = np.unique(border_edges(faces))
    everything = np.arange(len(vertices))
    if not one_sided or len(border) == 0:
        return [(everything, radius)]
    near = np.asarray(KDTree(vertices[border]).query(vertices)[0]) < radius / 2
    return [(everything[~near], radius), (everything[near], AT_BORDERS * radius)]


@dataclass(frozen=True)
class _Cloud:
    vertices: Array
    normals: Array
    tree: KDTree
    density: float


def _fit(cloud: _Cloud, which: IntArray, radius_mm: float) -> tuple[Array, Array, Array, Array, Array]:
    """Return points, normals, tangents, second forms and the residual's sigma at some vertices."""
    if len(which) == 0:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 2, 3)), np.empty((0, 3)), np.empty(0)
    wanted = int(1.1 * cloud.density * np.pi * radius_mm**2) + 4
    k = min(int(np.clip(wanted, 14, MAX_NEIGHBOURS)), len(cloud.vertices))
    distance, index = (np.asarray(column) for column in cloud.tree.query(cloud.vertices[which], k=k))
    scale = np.maximum(radius_mm, 1.05 * distance[:, min(9, k - 1)])
    x0, n0 = cloud.vertices[which], cloud.normals[which]
    t0 = tangents_of(n0)
    d = cloud.vertices[index] - x0[:, None]
    local = np.einsum("nkj,naj->ank", d, np.concatenate([t0, n0[:, None]], axis=1))
    u, v = local[0] / scale[:, None], local[1] / scale[:, None]
    # Neighbours across a thin wall face the other way and are left out.
    same_side = np.einsum("nkj,nj->nk", cloud.normals[index], n0) > 0.3
    weight = np.clip(1 - (distance / scale[:, None]) ** 2, 0, None) ** 2 * same_side
    basis = np.stack([np.ones_like(u), u, v, 0.5 * u * u, 0.5 * v * v, u * v], axis=-1)
    weighted = (basis * weight[..., None]).transpose(0, 2, 1)
    A = weighted @ basis + 1e-9 * np.eye(6)
    c = np.linalg.solve(A, weighted @ local[2][..., None])[..., 0]
    residual = local[2] - (basis @ c[..., None])[..., 0]
    inside = weight > 0
    freedom = np.maximum(inside.sum(axis=1) - 6, 1)
    sigma = np.sqrt((residual**2 * inside).sum(axis=1) / freedom)
    powers = np.stack([scale**p for p in (0, 1, 1, 2, 2, 2)], axis=1)
    return (*_reframed(x0, n0, t0, c / powers), sigma)


def _reframed(x0: Array, n0: Array, t0: Array, c: Array) -> tuple[Array, Array, Array, Array]:
    """Turn height fits into points with their own tangent plane and second form there."""
    normal = n0 - c[:, 1, None] * t0[:, 0] - c[:, 2, None] * t0[:, 1]
    stretch = np.linalg.norm(normal, axis=1)
    normal /= stretch[:, None]
    tangents = tangents_of(normal)
    # Each new tangent's (u, v) in the old frame; h_ab = t_a' H t_b / sqrt(1 + slope^2).
    uv = np.einsum("naj,nbj->nab", tangents, t0)
    H = np.stack([np.stack([c[:, 3], c[:, 5]], -1), np.stack([c[:, 5], c[:, 4]], -1)], -2)
    second = np.einsum("nac,ncd,nbd->nab", uv, H, uv) / stretch[:, None, None]
    quadric = np.stack([second[:, 0, 0], second[:, 0, 1], second[:, 1, 1]], axis=1)
    return x0 + c[:, :1] * n0, normal, tangents, quadric


def tangents_of(normals: Array) -> Array:
    """Return (N, 2, 3) orthonormal tangents that make a right-handed frame with unit normals (N, 3)."""
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(helper, normals)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-12)
    return np.stack([first, np.cross(normals, first)], axis=1)
