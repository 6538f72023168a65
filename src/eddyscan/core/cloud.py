"""A point cloud with its frame's name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, apply, rotate


@dataclass(frozen=True)
class PointCloud:
    """Points in one frame.

    Attributes
    ----------
    points : (N, 3) float64 [mm, `frame`]
        All finite.
    frame : str
        For example "camera", "table" or "part".
    normals : (N, 3) float64 or None
        Unit outward normals.
    name : str
        The file's or the view's name, used in messages.
    dropped : int
        Points left out when it was read because they were NaN or infinite.
    """

    points: Array
    frame: str = "camera"
    normals: Array | None = None
    name: str = "cloud"
    dropped: int = 0

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise GeometryError(f"{self.name}: points have shape {self.points.shape}, needed is (N, 3).")
        if not np.isfinite(self.points).all():
            bad = int((~np.isfinite(self.points).all(axis=1)).sum())
            raise GeometryError(f"{self.name}: {bad} of {len(self.points)} points are NaN or infinite; remove them.")
        if self.normals is not None and self.normals.shape != self.points.shape:
            raise GeometryError(f"{self.name}: {len(self.normals)} normals for {len(self.points)} points.")

    def __len__(self) -> int:
        return len(self.points)

    def moved(self, T_to_frame: Array, frame: str) -> PointCloud:
        """Return the cloud in another frame."""
        normals = None if self.normals is None else rotate(T_to_frame, self.normals)
        return PointCloud(apply(T_to_frame, self.points), frame, normals, self.name, self.dropped)
