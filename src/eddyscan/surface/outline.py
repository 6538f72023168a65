"""The part's outline, placed by its side walls.

Depth edges are the worst pixels of a stereo camera: matching windows fatten
the foreground by up to 3 px. The wall below an edge is an ordinary surface
seen by the tilted views, so the contour of the footprint only says *where to
look*, and the wall's points say where the edge is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array
from eddyscan.surface.nearest import nearest
from eddyscan.surface.sides import straightened

CELL_MM = 0.5
BRIDGE = 21  # cells: bites narrower than this are glare or shadow, seen again when the edges are measured
SPACING_MM = 1.0
WALL_SLOPE = 0.35  # |n_z| of a wall's normal at most
WALL_REACH_MM = 3.0
SMOOTH_MM = 4.0


@dataclass(frozen=True)
class Outline:
    """A closed contour.

    Attributes
    ----------
    polygon : (M, 2) [mm], counter-clockwise
    wall_share : float
        Share of its length that side walls have placed; the rest is the footprint's own edge.
    straight_deg, straight_mm : (S,) directions [deg] and lengths [mm] of its straight sides
    """

    polygon: Array
    wall_share: float
    straight_deg: Array
    straight_mm: Array

    def moved(self, T: Array) -> Outline:
        """Return the outline in another frame that differs by a turn about z and a shift."""
        turn = float(np.degrees(np.arctan2(T[1, 0], T[0, 0])))
        return Outline(
            self.polygon @ T[:2, :2].T + T[:2, 3], self.wall_share, self.straight_deg + turn, self.straight_mm
        )


def trace_outline(points: Array, walls: Array, wall_normals: Array) -> Outline:
    """Trace the footprint of points (N, 3) and move it onto the side walls.

    Parameters
    ----------
    points : (N, 3) [mm] of the part alone, z up
    walls : (M, 3) [mm] surfels; only those that are steep count
    wall_normals : (M, 3) unit outward
    """
    contour = _resampled(_footprint_contour(points))
    normal = outward(contour)
    offset, known = wall_offsets(contour, normal, walls, wall_normals)
    moved = contour + normal * offset[:, None]
    polygon, directions, lengths = straightened(moved, known, rough=True)
    return Outline(polygon, float(known.mean()), directions, lengths)


def _footprint_contour(points: Array) -> Array:
    import cv2

    low = points[:, :2].min(axis=0) - 4 * CELL_MM
    cell = np.floor((points[:, :2] - low) / CELL_MM).astype(np.int64)
    shape = cell.max(axis=0) + 5
    count = np.bincount(cell[:, 0] * shape[1] + cell[:, 1], minlength=int(shape.prod())).reshape(shape)
    typical = float(np.median(count[count > 0]))
    solid = (count >= max(1.0, 0.15 * typical)).astype(np.uint8)
    solid = cv2.morphologyEx(np.pad(solid, BRIDGE), cv2.MORPH_CLOSE, np.ones((BRIDGE, BRIDGE), np.uint8))
    solid = solid[BRIDGE:-BRIDGE, BRIDGE:-BRIDGE]
    solid = cv2.morphologyEx(solid, cv2.MORPH_OPEN, np.ones((9, 9), np.uint8))
    contours, _ = cv2.findContours(solid, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        raise GeometryError(
            f"no footprint larger than 2.5 mm among {len(points)} points of the part: too few views see it."
        )
    longest = max(contours, key=cv2.contourArea)[:, 0, ::-1]
    return np.asarray((longest + 0.5) * CELL_MM + low)


def _resampled(contour: Array) -> Array:
    """Return the closed contour at even spacing, smoothed below 1 mm, counter-clockwise."""
    area = 0.5 * float(np.sum(contour[:, 0] * np.roll(contour[:, 1], -1) - np.roll(contour[:, 0], -1) * contour[:, 1]))
    loop = contour if area > 0 else contour[::-1]
    smooth = gaussian_filter1d(loop, 2.0, axis=0, mode="wrap")
    return even_spacing(smooth, SPACING_MM)


def even_spacing(loop: Array, spacing_mm: float) -> Array:
    """Return a closed polygon's points at even arc spacing."""
    closed = np.concatenate([loop, loop[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    count = max(8, round(arc[-1] / spacing_mm))
    at = np.arange(count) * arc[-1] / count
    return np.stack([np.interp(at, arc, closed[:, k]) for k in range(2)], axis=1)


def outward(contour: Array) -> Array:
    """Return the unit outward normals (S, 2) of an evenly spaced, counter-clockwise closed contour."""
    smooth = gaussian_filter1d(contour, 2.0 / SPACING_MM, axis=0, mode="wrap")
    tangent = np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
    return np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)


def wall_offsets(contour: Array, normal: Array, walls: Array, wall_normals: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the shift along the contour's normal [mm] that puts it on the walls, and where walls are known."""
    steep = np.abs(wall_normals[:, 2]) < WALL_SLOPE
    walls, wall_normals = walls[steep, :2], wall_normals[steep, :2]
    count = len(contour)
    if len(walls) < 20:
        return np.zeros(count), np.zeros(count, dtype=bool)
    at = nearest(contour, walls)
    offset = ((walls - contour[at]) * normal[at]).sum(axis=1)
    facing = (wall_normals * normal[at]).sum(axis=1)
    keep = (np.abs(offset) < WALL_REACH_MM) & (facing > 0.85)
    at, offset = at[keep], offset[keep]
    sigma = SMOOTH_MM / SPACING_MM
    estimate: Array = np.full(count, float(np.median(offset)) if offset.size else 0.0)
    support = np.zeros(count)
    for width in (3.0, 2.0, 1.5, 1.0, 1.0, 1.0):
        weight = np.clip(1 - ((offset - estimate[at]) / width) ** 2, 0, None) ** 2
        total = gaussian_filter1d(np.bincount(at, weight, minlength=count), sigma, mode="wrap")
        moment = gaussian_filter1d(np.bincount(at, weight * offset, minlength=count), sigma, mode="wrap")
        support = np.asarray(total, dtype=np.float64)
        estimate = np.where(total > 0.3, moment / np.maximum(total, 1e-9), estimate)
    known = support > 0.3
    if known.any():
        estimate = np.where(known, estimate, np.median(estimate[known]))
    return estimate, np.asarray(known)
