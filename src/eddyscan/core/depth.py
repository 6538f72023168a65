"""A depth image and the pinhole camera that took it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, checked_transform


class PinholeCamera(BaseModel):
    """Intrinsics [px] of an undistorted camera, as `camera.json` holds them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    fx: float = Field(gt=0)
    fy: float = Field(gt=0)
    cx: float
    cy: float
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    depth_scale_mm: float = Field(gt=0, description="mm per count of the 16-bit depth image")


@dataclass(frozen=True)
class DepthImage:
    """One depth view.

    Attributes
    ----------
    depth_mm : (H, W) float64 [mm]
        Distance along the optical axis; NaN where the camera saw nothing.
    camera : PinholeCamera
    name : str
        The file's or the view's name, used in messages.
    T_world_camera : (4, 4) or None
        Pose when a robot, turntable or fiducial sheet gave one.
    time_s : float or None
        When it was taken [s since the epoch].
    intensity : (H, W) uint8 or None
        Infrared or grey image of the same pixels, when the camera has one.
    """

    depth_mm: Array
    camera: PinholeCamera
    name: str = "view"
    T_world_camera: Array | None = None
    time_s: float | None = None
    intensity: np.ndarray | None = None

    def __post_init__(self) -> None:
        expected = (self.camera.height, self.camera.width)
        if self.depth_mm.shape != expected:
            h, w = self.depth_mm.shape[:2]
            raise GeometryError(
                f"depth image {self.name} is {w} x {h} px, its camera says {expected[1]} x {expected[0]}. "
                "Use the camera.json that belongs to this image size."
            )
        if self.T_world_camera is not None:
            checked_transform(self.T_world_camera, f"pose of {self.name}")
