"""The one place of this room that talks to Open3D."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.open3d_loader import load_open3d as open3d


def cloud(points: Array, normals: Array | None = None) -> Any:
    """Return an Open3D point cloud of points (N, 3)."""
    o3d = open3d()
    result = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.ascontiguousarray(points)))
    if normals is not None:
        result.normals = o3d.utility.Vector3dVector(np.ascontiguousarray(normals))
    return result


def poisson(points: Array, normals: Array, depth: int) -> tuple[Array, IntArray]:
    """Return vertices and faces of the screened Poisson surface (Kazhdan and Hoppe, ACM TOG 2013)."""
    o3d = open3d()
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        cloud(points, normals), depth=depth, n_threads=1
    )
    return np.asarray(mesh.vertices).copy(), np.asarray(mesh.triangles).astype(np.int64)


def point_to_point_icp(
    source: Array, target: Array, guess: Array, *, voxel_mm: float, reach_mm: float
) -> tuple[Array, float, float]:
    """Return T_target_source, inlier RMSE [mm] and fitness of point-to-point ICP (Besl and McKay 1992)."""
    o3d = open3d()
    a, b = (cloud(p).voxel_down_sample(voxel_mm) for p in (source, target))
    registration = o3d.pipelines.registration
    result = registration.registration_icp(
        a,
        b,
        reach_mm,
        guess,
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(max_iteration=60),
    )
    return np.asarray(result.transformation).copy(), float(result.inlier_rmse), float(result.fitness)


def without_outliers(points: Array, neighbours: int, ratio: float) -> Array:
    """Return the points that statistical outlier removal keeps."""
    kept, _ = cloud(points).remove_statistical_outlier(neighbours, ratio)
    return np.asarray(kept.points).copy()


def estimated_normals(points: Array, neighbours: int) -> Array:
    """Return (N, 3) unit normals from local planes, turned upwards."""
    o3d = open3d()
    sampled = cloud(points)
    sampled.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(neighbours))
    normals = np.asarray(sampled.normals).copy()
    return np.asarray(normals * np.where(normals[:, 2:] < 0, -1.0, 1.0))


def closest_on_mesh(vertices: Array, faces: IntArray) -> Callable[[Array], tuple[Array, Array]]:
    """Return a function from points (N, 3) to their feet (N, 3) on a mesh and the triangles' unit normals there."""
    o3d = open3d()
    middle = vertices.mean(axis=0)  # single precision inside: keep numbers small
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.ascontiguousarray(vertices - middle, dtype=np.float32)),
        o3d.core.Tensor(np.ascontiguousarray(faces, dtype=np.uint32)),
    )

    def find(points: Array) -> tuple[Array, Array]:
        found = scene.compute_closest_points(o3d.core.Tensor(np.ascontiguousarray(points - middle, dtype=np.float32)))
        foot = found["points"].numpy().astype(np.float64) + middle
        normal = found["primitive_normals"].numpy().astype(np.float64)
        return foot, normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)

    return find
