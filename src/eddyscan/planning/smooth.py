"""A smooth surface through a mesh: local quadrics over the probe's footprint.

Every vertex gets a weighted least-squares quadric over its neighbours
(moving least squares, Levin 1998; weights of Wendland 1995). A point inside
a triangle blends the quadrics of its corners, so positions, normals and
curvature come from the smooth fit at that very point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import face_vectors, vertex_normals

NORMAL_TARGET_DEG = 0.4
MAX_NEIGHBOURS = 64
CHUNK = 8192


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
            P, n = self._lift(points, vertex)
            where += weight[:, corner, None] * P
            normal += weight[:, corner, None] * n
        return where, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _lift(self, points: Array, vertex: IntArray) -> tuple[Array, Array]:
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


def smoothed(vertices: Array, faces: IntArray, footprint_mm: float) -> SmoothSurface:
    """Fit the smooth surface of a mesh.

    Parameters
    ----------
    vertices : (V, 3) [mm], faces : (F, 3)
    footprint_mm : float
        Width the probe sees: the least diameter of the fits. It grows with the
        mesh's noise until normals are good to about 0.4 degrees.
    """
    area = 0.5 * np.linalg.norm(face_vectors(vertices, faces), axis=1).sum()
    density = len(vertices) / max(area, 1e-12)
    least = max(footprint_mm / 2, 2.2 / np.sqrt(density))
    tree, normals = KDTree(vertices), vertex_normals(vertices, faces)
    sample = np.linspace(0, len(vertices) - 1, min(len(vertices), 600)).astype(np.int64)
    noise_mm = float(np.median(_fit(vertices, normals, tree, sample, least)[4]))
    # Slope error of a least-squares plane in a disc: 2 sigma / (sqrt(pi density) r^2).
    wanted = np.sqrt(2 * noise_mm / (np.radians(NORMAL_TARGET_DEG) * np.sqrt(np.pi * density)))
    radius = float(np.clip(wanted, least, 1.8 * least))
    parts = [
        _fit(vertices, normals, tree, np.arange(k, min(k + CHUNK, len(vertices))), radius)
        for k in range(0, len(vertices), CHUNK)
    ]
    fitted, n, t, q, _ = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SmoothSurface(fitted, faces, n, t, q, noise_mm, radius)


def _fit(
    vertices: Array, normals: Array, tree: KDTree, which: IntArray, radius_mm: float
) -> tuple[Array, Array, Array, Array, Array]:
    k = min(MAX_NEIGHBOURS, len(vertices))
    distance, index = (np.asarray(column) for column in tree.query(vertices[which], k=k))
    radius = np.maximum(radius_mm, 1.05 * distance[:, min(9, k - 1)])[:, None]
    x0, n0 = vertices[which], normals[which]
    t0 = tangents_of(n0)
    d = vertices[index] - x0[:, None]
    u, v = np.einsum("nkj,nj->nk", d, t0[:, 0]), np.einsum("nkj,nj->nk", d, t0[:, 1])
    h = np.einsum("nkj,nj->nk", d, n0)
    # Neighbours across a thin wall face the other way and are left out.
    same_side = np.einsum("nkj,nj->nk", normals[index], n0) > 0.3
    ratio = np.clip(distance / radius, 0, 1)
    weight = (1 - ratio) ** 4 * (4 * ratio + 1) * same_side
    scale = radius
    basis = np.stack([np.ones_like(u), u / scale, v / scale, *(0.5 * (a * b) / scale**2 for a, b in ((u, u), (v, v)))])
    basis = np.concatenate([basis, (u * v / scale**2)[None]])
    A = np.einsum("ank,nk,bnk->nab", basis, weight, basis) + 1e-9 * np.eye(6)
    b = np.einsum("ank,nk,nk->na", basis, weight, h)
    c = np.linalg.solve(A, b[..., None])[..., 0]
    residual = h - np.einsum("na,ank->nk", c, basis)
    freedom = np.maximum((weight > 0).sum(axis=1) - 6, 1)
    sigma = np.sqrt((residual**2 * (weight > 0)).sum(axis=1) / freedom)
    return (*_reframed(x0, n0, t0, c / np.concatenate([scale**p for p in (0, 1, 1, 2, 2, 2)], axis=1)), sigma)


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
