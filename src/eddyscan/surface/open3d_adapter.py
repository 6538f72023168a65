"""The one place of this room that talks to Open3D."""

from __future__ import annotations

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
