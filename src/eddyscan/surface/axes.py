"""The part frame: flat side down, long side along x, origin at the outline's corner.

Rule for the remaining half turn: of the two orientations the one whose half
near the origin (small x) is the higher on average. When both halves are equal
within `LEVEL_MM`, the half of smaller y decides the same way; when these are equal
too, the part is the same both ways round as far as the camera can tell, the
orientation is kept as found and a warning says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array, apply, rotation_about_z, transform
from eddyscan.surface.outline import Outline

LEVEL_MM = 0.15
FLUSH_DEG = 2.0
FLUSH_SHARE = 0.6  # a side shorter than this share of the box may be a chord of a curved border


@dataclass(frozen=True)
class PartAxes:
    """Where the part frame is.

    Attributes
    ----------
    T_part_box : (4, 4) from the footprint box's frame
    size_mm : (2,) of the outline's bounding box, long side first
    warnings : tuple of str
    """

    T_part_box: Array
    size_mm: Array
    warnings: tuple[str, ...]


def align(outline: Outline, points: Array) -> PartAxes:
    """Find the part frame from the outline (box frame) and the part's points (N, 3) [mm, box frame]."""
    R = rotation_about_z(-_box_angle_deg(outline))
    loop = outline.polygon @ R[:2, :2].T
    if np.ptp(loop[:, 1]) > 1.02 * np.ptp(loop[:, 0]):
        R = rotation_about_z(-90.0) @ R
        loop = outline.polygon @ R[:2, :2].T
    T = transform(R, np.append(-loop.min(axis=0), 0.0))
    size = np.ptp(loop, axis=0)
    turn, warnings = _half_turn(apply(T, points), size)
    if turn:
        T = transform(rotation_about_z(180.0), (size[0], size[1], 0.0)) @ T
    return PartAxes(T, size, warnings)


def _box_angle_deg(outline: Outline) -> float:
    """Return the direction of the min-area box, turned onto the straight sides that are flush with it."""
    import cv2

    _, size, angle = cv2.minAreaRect(outline.polygon.astype(np.float32))
    off = (outline.straight_deg - angle + 45.0) % 90.0 - 45.0
    along = np.abs((outline.straight_deg - angle + 90.0) % 180.0 - 90.0) < 45.0
    flush = (np.abs(off) < FLUSH_DEG) & (outline.straight_mm > FLUSH_SHARE * np.where(along, size[0], size[1]))
    if flush.any():
        angle += float(np.average(off[flush], weights=outline.straight_mm[flush] ** 3))
    return float(angle)


def _half_turn(points: Array, size: Array) -> tuple[bool, tuple[str, ...]]:
    height = _cell_heights(points, size)
    nx, ny = height.shape
    for first, second in (
        (height[: nx // 2], height[nx - nx // 2 :]),
        (height[:, : ny // 2], height[:, ny - ny // 2 :]),
    ):
        difference = float(np.nanmean(first) - np.nanmean(second))
        if abs(difference) > LEVEL_MM:
            return difference < 0, ()
    return False, (
        "the part looks the same after half a turn about z: its x direction is a free choice; "
        "mark one end if it matters",
    )


def _cell_heights(points: Array, size: Array, cell_mm: float = 2.0) -> Array:
    """Return the mean height per cell (nx, ny), NaN where nothing was seen; walls and rims left out."""
    n = np.maximum(np.round(size / cell_mm).astype(int), 2)
    index = np.floor(points[:, :2] / size * n).astype(int)
    inside = ((index >= 1) & (index < n - 1)).all(axis=1) & (points[:, 2] > 3.0)
    flat = index[inside, 0] * n[1] + index[inside, 1]
    count = np.bincount(flat, minlength=int(n.prod()))
    total = np.bincount(flat, points[inside, 2], minlength=int(n.prod()))
    return np.asarray(np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0).reshape(n))
