"""Depth pixels to points: the pinhole model, and the rays that never change."""

from __future__ import annotations

import numpy as np

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import Array


def rays(camera: PinholeCamera) -> Array:
    """Return the (H, W, 3) directions through each pixel with z = 1 [camera frame]."""
    x = (np.arange(camera.width) - camera.cx) / camera.fx
    y = (np.arange(camera.height) - camera.cy) / camera.fy
    X, Y = np.meshgrid(x, y)
    return np.stack([X, Y, np.ones_like(X)], axis=-1)


def deproject(depth_mm: Array, camera: PinholeCamera) -> Array:
    """Turn a depth image into points in the camera frame.

    Parameters
    ----------
    depth_mm : (H, W) float64 [mm]
        Distance along the optical axis; NaN where the camera saw nothing.
    camera : PinholeCamera
        Intrinsics [px] for this image size.

    Returns
    -------
    points : (N, 3) float64 [mm, camera frame]
        One point per valid pixel, row-major.

    Notes
    -----
    z = depth(i, j), x = (j - cx) z / fx, y = (i - cy) z / fy: equations 3 to 5
    of the reference study.
    """
    i, j = np.nonzero(np.isfinite(depth_mm))
    z = np.asarray(depth_mm, dtype=np.float64)[i, j]
    return np.stack([(j - camera.cx) * z / camera.fx, (i - camera.cy) * z / camera.fy, z], axis=1)


def project(points: Array, camera: PinholeCamera) -> Array:
    """Return the (N, 2) pixel coordinates (column, row) of points (N, 3) [mm, camera]; NaN behind the camera."""
    z = np.where(points[:, 2] > 0, points[:, 2], np.nan)
    return np.stack(
        [camera.fx * points[:, 0] / z + camera.cx, camera.fy * points[:, 1] / z + camera.cy],
        axis=1,
    )
