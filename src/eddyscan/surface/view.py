"""One view on its way through the surface room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import Array, apply
from eddyscan.surface.clean import Depth32
from eddyscan.surface.surfels import SurfelImage


@dataclass(frozen=True)
class View:
    """A cleaned depth image, its surfels and, once known, its pose.

    Attributes
    ----------
    name : str
    depth : (H, W) float32 [mm], cleaned, NaN = none
    raw : (H, W) float32 [mm], range-gated alone, NaN = none
    camera : PinholeCamera
    surfels : SurfelImage
    T_world_camera : (4, 4) pose in the table frame (z = 0 is the table)
    """

    name: str
    depth: Depth32
    raw: Depth32
    camera: PinholeCamera
    surfels: SurfelImage
    T_world_camera: Array

    def points_in(self, T_box_world: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return full-resolution points inside a box and their distances.

        Parameters
        ----------
        T_box_world : (4, 4)
        low, high : (3,) limits of the box [mm, box frame]

        Returns
        -------
        points : (N, 3) float64 [mm, box frame]
        range_mm : (N,) distance along the optical axis
        """
        T = T_box_world @ self.T_world_camera
        rows, columns = _window(self.camera, T, low, high)
        patch = self.depth[rows, columns]
        i, j = np.nonzero(np.isfinite(patch))
        z = patch[i, j].astype(np.float64)
        x = (j + columns.start - self.camera.cx) / self.camera.fx * z
        y = (i + rows.start - self.camera.cy) / self.camera.fy * z
        points = np.stack([x, y, z], axis=1) @ T[:3, :3].T + T[:3, 3]
        inside = ((points >= low) & (points <= high)).all(axis=1)
        return points[inside], z[inside]

    def surfels_in(self, T_box_world: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return surfel points and normals (N, 3) inside a box, in the box frame."""
        T = T_box_world @ self.T_world_camera
        window = _window(self.surfels.camera, T, low, high)
        patch = self.surfels.points[window]
        valid = np.isfinite(patch[..., 2])
        points = apply(T, patch[valid].astype(np.float64))
        inside = ((points >= low) & (points <= high)).all(axis=1)
        normals = self.surfels.normals[window][valid][inside].astype(np.float64) @ T[:3, :3].T
        return points[inside], normals


def _window(camera: PinholeCamera, T_box_camera: Array, low: Array, high: Array) -> tuple[slice, slice]:
    """Return the rows and columns of the image that can show the box."""
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T
    seen = (corners - T_box_camera[:3, 3]) @ T_box_camera[:3, :3]
    height, width = camera.height, camera.width
    if (seen[:, 2] < 1.0).any():
        return slice(0, height), slice(0, width)
    u = camera.fx * seen[:, 0] / seen[:, 2] + camera.cx
    v = camera.fy * seen[:, 1] / seen[:, 2] + camera.cy
    rows = slice(int(np.clip(v.min() - 1, 0, height)), int(np.clip(v.max() + 2, 0, height)))
    return rows, slice(int(np.clip(u.min() - 1, 0, width)), int(np.clip(u.max() + 2, 0, width)))
