"""Surfaces that are no height field: 3-D moving least squares, then Poisson, then cut back to what was seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.technique import Surface
from eddyscan.surface.grid_mesh import inside_polygon, without_vertices
from eddyscan.surface.nearest import nearest_with_distance, neighbours
from eddyscan.surface.open3d_adapter import poisson
from eddyscan.surface.part_frame import PartFrame
from eddyscan.surface.view import View

VOXEL_MM = 1.0
RADIUS_MM = 6.0
NEIGHBOURS = 40
REACH_MM = 2.0
SCALE_FLOOR_MM = 0.05


def fuse_free_form(views: Sequence[View], part: PartFrame, settings: Surface) -> tuple[SurfaceMesh, tuple[str, ...]]:
    """Fuse oriented surfels of all views; returns the mesh and warnings."""
    low, high = part.box(1.5)
    found = [v.surfels_in(part.T_part_world, low, high) for v in views]
    points, normals = (np.concatenate([f[k] for f in found]) for k in range(2))
    points, normals = _voxels(points, normals)
    if len(points) < 200:
        raise GeometryError(
            f"{len(points)} surface points on the part (need 200): too little was seen. Take more views."
        )
    points, normals, sigma = _moving_least_squares(points, normals)
    extent = float(np.ptp(points, axis=0).max()) * 1.1
    depth = int(np.clip(np.ceil(np.log2(extent / settings.grid_mm)), 5, 9))
    vertices, faces = poisson(points, normals, depth)
    distance, foot = nearest_with_distance(points, vertices)
    outside = (distance > REACH_MM) | (vertices[:, 2] < 0.0)
    outside |= ~inside_polygon(vertices[:, :2], part.outline.polygon) & (distance > 1.0)
    used, faces = without_vertices(faces, outside)
    if not len(faces):
        raise GeometryError("the free-form surface came out empty: the views disagree or see too little of the part.")
    return SurfaceMesh.from_triangles(vertices[used], faces, sigma[foot[used]]), ()


def _voxels(points: Array, normals: Array) -> tuple[Array, Array]:
    """Return one mean point and normal per voxel."""
    key = np.floor(points / VOXEL_MM).astype(np.int64)
    key -= key.min(axis=0)
    size = key.max(axis=0) + 1
    flat = (key[:, 0] * size[1] + key[:, 1]) * size[2] + key[:, 2]
    _, at, count = np.unique(flat, return_inverse=True, return_counts=True)
    mean = [np.stack([np.bincount(at, a[:, k]) / count for k in range(3)], axis=1) for a in (points, normals)]
    length = np.linalg.norm(mean[1], axis=1)
    keep = (length > 0.7) & (count >= 2)
    return mean[0][keep], mean[1][keep] / length[keep, None]


def _moving_least_squares(points: Array, normals: Array) -> tuple[Array, Array, Array]:
    """Project every point on a robust local quadratic; returns points, normals and standard uncertainty [mm]."""
    tree = KDTree(points)
    moved, turned, sigma = [], [], []
    for begin in range(0, len(points), 4000):
        chunk = slice(begin, begin + 4000)
        distance, index = neighbours(tree, points[chunk], NEIGHBOURS, RADIUS_MM)
        p, n, s = _project(points[chunk], normals[chunk], points, normals, distance, index)
        moved.append(p)
        turned.append(n)
        sigma.append(s)
    return np.concatenate(moved), np.concatenate(turned), np.concatenate(sigma)


def _project(
    at: Array, normal: Array, points: Array, normals: Array, distance: Array, index: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    near = np.isfinite(distance)
    j = np.where(near, index, 0).astype(np.int64)
    side = np.cross(normal, np.where(np.abs(normal[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normal, side)
    d = points[j] - at[:, None]
    u, v, w = ((d * axis[:, None]).sum(-1) for axis in (side, other, normal))
    agree = (normals[j] * normal[:, None]).sum(-1) > 0.7
    weight = np.where(near & agree, np.exp(-((np.where(near, distance, 0) / (RADIUS_MM / 2)) ** 2)), 0.0)
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    robust = np.ones_like(weight)
    solution = np.zeros((len(at), 6))
    inverse = np.zeros((len(at), 6, 6))
    residual = w
    for _ in range(3):
        W = (weight * robust)[..., None]
        A = np.swapaxes(basis, 1, 2) @ (W * basis) + 1e-6 * np.eye(6)
        inverse = np.linalg.inv(A)
        solution = (inverse @ (np.swapaxes(basis, 1, 2) @ (W * w[..., None])))[..., 0]
        residual = w - (basis @ solution[..., None])[..., 0]
        spread = np.median(np.where(weight > 0, np.abs(residual), np.nan_to_num(np.abs(residual))), axis=1)
        scale = np.maximum(1.4826 * spread, SCALE_FLOOR_MM)[:, None]
        robust = np.clip(1 - (residual / (4.685 * scale)) ** 2, 0, None) ** 2
    moved = at + solution[:, :1] * normal
    turned = normal - solution[:, 1:2] * side - solution[:, 2:3] * other
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    return moved, turned, np.asarray(scale[:, 0] * np.sqrt(np.clip(inverse[:, 0, 0], 0, 1)))
