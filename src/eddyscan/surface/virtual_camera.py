"""A cloud as a depth image: seen again from where its camera must have stood.

Views that come as point clouds get the same cleaning and registration as depth
images. A depth camera's own cloud has its origin at the camera and z forward,
so re-projecting it gives the image back; any other cloud is looked at from
above its largest plane.
"""

from __future__ import annotations

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage, PinholeCamera
from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array

MAX_SIDE_PX = 1600
MIN_POINTS = 1000
WIDEST = 1.5  # tangent of half the field of view a depth camera can have


def as_depth_image(cloud: PointCloud) -> DepthImage:
    """Render a cloud from its own origin, at a resolution that keeps about one point per pixel.

    Raises
    ------
    GeometryError
        When there are too few points, or they do not lie in front of the origin.
    """
    points = cloud.points
    if len(points) < MIN_POINTS:
        raise GeometryError(
            f"{cloud.name} has {len(points)} points (need {MIN_POINTS}); it cannot be a view of a part."
        )
    camera = _camera(points, cloud.name)
    u = np.rint(camera.fx * points[:, 0] / points[:, 2] + camera.cx).astype(np.int64)
    v = np.rint(camera.fy * points[:, 1] / points[:, 2] + camera.cy).astype(np.int64)
    inside = (u >= 0) & (v >= 0) & (u < camera.width) & (v < camera.height)
    flat = v[inside] * camera.width + u[inside]
    depth = np.full(camera.width * camera.height, np.inf)
    np.minimum.at(depth, flat, points[inside, 2])
    depth[~np.isfinite(depth)] = np.nan
    return DepthImage(depth.reshape(camera.height, camera.width), camera, cloud.name)


def _camera(points: Array, name: str) -> PinholeCamera:
    ahead = points[:, 2] > 0
    slope = points[ahead, :2] / points[ahead, 2:]
    if ahead.mean() < 0.99 or np.quantile(np.abs(slope), 0.99) > WIDEST:
        raise GeometryError(
            f"{name}: {100 * ahead.mean():.0f} % of the points lie in front of the origin (need 99 %) within a field "
            f"of view of {2 * np.degrees(np.arctan(WIDEST)):.0f} deg. A view's frame is the camera's: x right, y down, "
            "z forward, origin at the lens."
        )
    low, high = np.quantile(slope, 0.001, axis=0), np.quantile(slope, 0.999, axis=0)
    unique = np.unique(np.round(slope[:: max(1, len(slope) // 200_000)], 6), axis=0)
    share = len(unique) / max(len(slope[:: max(1, len(slope) // 200_000)]), 1)
    if np.min(high - low) < 1e-3:
        raise GeometryError(
            f"{name}: its {len(points)} points lie in one direction from the camera: it shows no surface. "
            "Check for repeated points and export it again."
        )
    density = np.sqrt(share * len(slope) / np.prod(np.maximum(high - low, 1e-6)))
    f = float(np.clip(density, 50, MAX_SIDE_PX / np.max(high - low)))
    width, height = (int(np.ceil(f * (high[k] - low[k]))) + 4 for k in range(2))
    return PinholeCamera(
        fx=f, fy=f, cx=2 - f * low[0], cy=2 - f * low[1], width=width, height=height, depth_scale_mm=0.1
    )
