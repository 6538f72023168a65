"""The infrared picture of the virtual camera: plain shading, and the fiducial sheet on the table.

Only what fiducials need: albedo times the lamp's angle, a lens blur, noise, eight
bits. The dot pattern is taken to be off for this picture.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.fiducials import FiducialSheet
from eddyscan.core.frames import Array, invert, rotation_about_z, transform
from eddyscan.devices.sim.camera_raycast import Hits
from eddyscan.devices.sim.world_scene import PART_SOLID, Scene

TABLE_SOLID = 0
ALBEDO = {TABLE_SOLID: 0.35, PART_SOLID: 0.6}
CLUTTER_ALBEDO = 0.45
PAPER, INK = 0.85, 0.06
SHEET_PX_PER_MM = 4.0
BLUR_PX = 0.7
NOISE_GREY = 2.0
FULL_GREY = 235.0


def sheet_pose(scene: Scene, sheet: FiducialSheet, seed: int) -> Array:
    """Return T_table_sheet: under the part, roughly centred and aligned, as a person lays it."""
    rng = np.random.default_rng([seed, 12])
    middle = scene.part.top_mesh(8.0).vertices.mean(axis=0)
    flat = np.diag([1.0, -1.0, -1.0])
    width, height = sheet.size_mm
    shift = rng.uniform(-8.0, 8.0, 2)
    lying = transform(rotation_about_z(rng.uniform(-6.0, 6.0)) @ flat, (0.0, 0.0, 0.0))
    centred = transform(None, (-width / 2 + shift[0], -height / 2 + shift[1], 0.0))
    T_table_middle = scene.T_table_part @ transform(None, (middle[0], middle[1], 0.0))
    return np.asarray(T_table_middle @ lying @ centred)


class InfraredView:
    """Pictures of one table with one sheet on it."""

    def __init__(self, scene: Scene, sheet: FiducialSheet, seed: int) -> None:
        self._sheet = sheet
        self.T_table_sheet = sheet_pose(scene, sheet, seed)
        self._print = sheet.image(SHEET_PX_PER_MM).astype(np.float32) / 255.0

    def picture(
        self, hits: Hits, camera: PinholeCamera, T_table_camera: Array, rng: np.random.Generator
    ) -> NDArray[np.uint8]:
        """Return the infrared image (H, W) uint8 of what the rays met."""
        albedo = np.full(hits.depth_mm.shape, CLUTTER_ALBEDO, dtype=np.float32)
        for solid, value in ALBEDO.items():
            albedo[hits.solid == solid] = value
        x, y = self._on_sheet(hits, camera, T_table_camera)
        ink = cv2.remap(self._print, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=-1.0)
        printed = (hits.solid == TABLE_SOLID) & (ink >= 0)
        albedo[printed] = INK + (PAPER - INK) * ink[printed]
        grey = FULL_GREY * albedo * np.sqrt(np.clip(hits.facing, 0.0, 1.0))
        grey[~np.isfinite(hits.depth_mm)] = 0.0
        grey = cv2.GaussianBlur(grey, (0, 0), BLUR_PX)
        grey += NOISE_GREY * rng.standard_normal(grey.shape, dtype=np.float32)
        return np.asarray(np.clip(np.round(grey), 0, 255), dtype=np.uint8)

    def _on_sheet(
        self, hits: Hits, camera: PinholeCamera, T_table_camera: Array
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return where each pixel's spot lies in the print's own pixels."""
        T = (invert(self.T_table_sheet) @ T_table_camera).astype(np.float32)
        z = np.where(np.isfinite(hits.depth_mm), hits.depth_mm, 0.0).astype(np.float32)
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float32)
        points = np.stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z], axis=-1)
        at = points @ T[:2, :3].T + T[:2, 3]
        pixels = (at * np.float32(SHEET_PX_PER_MM) - np.float32(0.5)).astype(np.float32)
        return np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
