"""The reference study's own chain, kept for ever as the baseline.

Deproject, point-to-point ICP of each view to the one before it, crop,
statistical outlier removal, k-nearest-neighbour mean, normals, screened
Poisson at a chosen depth. What the study did by hand is done here the plainest
way: the rough poses, when the views carry some, start the ICP (published code:
no guess at all, identity), the crop is `settings.crop` or the part as found, the
axes are turned with the first view's table plane and the min-area box.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage
from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, apply, invert
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress
from eddyscan.core.registration import Registration
from eddyscan.core.technique import Surface
from eddyscan.surface.deproject import deproject
from eddyscan.surface.grid_mesh import without_vertices
from eddyscan.surface.nearest import neighbours
from eddyscan.surface.open3d_adapter import (
    estimated_normals,
    point_to_point_icp,
    poisson,
    without_outliers,
)
from eddyscan.surface.part_frame import PartFrame, locate_part
from eddyscan.surface.prepare import prepare
from eddyscan.surface.table import find_table

if TYPE_CHECKING:
    from eddyscan.surface.reconstruct import Reconstruction

VOXEL_MM = 2.0
REACH_MM = 10.0
OUTLIER_NEIGHBOURS, OUTLIER_RATIO = 20, 2.0
MEAN_NEIGHBOURS = 30
CLOUD_LIMIT = 200_000


def reconstruct_as_study(images: Sequence[DepthImage], settings: Surface, progress: Progress) -> Reconstruction:
    """Run the study's chain on depth images; same result type as `reconstruct`."""
    from eddyscan.surface.reconstruct import Reconstruction

    clouds = [_gated(image, settings) for image in images]
    chain = _chained_icp(images, clouds, progress)
    part = _hand_alignment(images, settings, chain)
    registrations = tuple(
        Registration(image.name, part.T_part_world @ T, rmse, fitness, True, (), "registered")
        for image, (T, rmse, fitness) in zip(images, chain, strict=True)
    )
    merged = np.concatenate([apply(r.T_target_source, c) for r, c in zip(registrations, clouds, strict=True)])
    low, high = _crop_box(settings, part)
    region = merged[((merged >= low) & (merged <= high)).all(axis=1)]
    if len(region) < 200:
        raise GeometryError(f"{len(region)} points are left inside the crop box (need 200): widen [surface.crop].")
    progress("filtering", 0, 1)
    smooth = _mean_filter(without_outliers(region, OUTLIER_NEIGHBOURS, OUTLIER_RATIO))
    progress("filtering", 1, 1)
    normals = estimated_normals(smooth, MEAN_NEIGHBOURS)
    progress("Poisson surface", 0, 1)
    vertices, faces = poisson(smooth, normals, settings.poisson_depth)
    progress("Poisson surface", 1, 1)
    outside = ((vertices < low) | (vertices > high)).any(axis=1)
    used, faces = without_vertices(faces, np.asarray(outside))
    mesh = SurfaceMesh.from_triangles(vertices[used], faces)
    step = max(1, int(np.ceil(len(region) / CLOUD_LIMIT)))
    cloud = PointCloud(np.ascontiguousarray(region[::step]), "part", name="merged")
    return Reconstruction(mesh, registrations, cloud, ("study's method: no stated uncertainty",), "study")


def _gated(image: DepthImage, settings: Surface) -> Array:
    inside = (image.depth_mm >= settings.range_min_mm) & (image.depth_mm <= settings.range_max_mm)
    return deproject(np.where(inside, image.depth_mm, np.nan), image.camera)


def _chained_icp(
    images: Sequence[DepthImage], clouds: Sequence[Array], progress: Progress
) -> list[tuple[Array, float, float]]:
    """Return T_first_view, inlier RMSE [mm] and fitness per view, each view matched to the one before."""
    chain = [(np.eye(4), 0.0, 1.0)]
    for k in range(1, len(clouds)):
        progress("ICP", k - 1, len(clouds) - 1)
        before, now = images[k - 1].T_world_camera, images[k].T_world_camera
        guess = np.eye(4) if before is None or now is None else invert(before) @ now
        T, rmse, fitness = point_to_point_icp(clouds[k], clouds[k - 1], guess, voxel_mm=VOXEL_MM, reach_mm=REACH_MM)
        chain.append((chain[-1][0] @ T, rmse, fitness))
    progress("ICP", 1, 1)
    return chain


def _hand_alignment(
    images: Sequence[DepthImage], settings: Surface, chain: list[tuple[Array, float, float]]
) -> PartFrame:
    """Stand in for the study's manual crop and rotation: the first view's table and part."""
    first = prepare(images[0], settings)
    table = find_table(first.surfels, first.name).T_table_camera
    part = locate_part([replace(first, T_world_camera=table)])
    del chain
    return replace(part, T_part_world=part.T_part_world @ table)


def _crop_box(settings: Surface, part: PartFrame) -> tuple[Array, Array]:
    low, high = np.array([-2.0, -2.0, 2.0]), part.size_mm + 2.0
    if settings.crop is not None:
        for k, limits in enumerate((settings.crop.x_mm, settings.crop.y_mm, settings.crop.z_mm)):
            if limits is not None:
                low[k], high[k] = limits
    return low, high


def _mean_filter(points: Array) -> Array:
    """Replace every point by the mean of its neighbours (the study's average filter)."""
    tree = KDTree(points)
    result = np.empty_like(points)
    for begin in range(0, len(points), 50_000):
        chunk = slice(begin, begin + 50_000)
        _, index = neighbours(tree, points[chunk], MEAN_NEIGHBOURS, np.inf)
        result[chunk] = points[index].mean(axis=1)
    return result
