"""The part's outline, placed by its side walls.

Depth edges are the worst pixels of a stereo camera: matching windows fatten
the foreground by up to 3 px. The wall below an edge is an ordinary surface
seen by the tilted views, so the contour of the footprint only says *where to
look*, and the wall's points say where the edge is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array
from eddyscan.surface.nearest import nearest

CELL_MM = 0.5
SPACING_MM = 1.0
WALL_SLOPE = 0.35  # |n_z| of a wall's normal at most
WALL_REACH_MM = 3.0
SMOOTH_MM = 4.0
STRAIGHT_MIN_MM = 20.0
STRAIGHT_RMS_MM = 0.25


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
    polygon, directions, lengths = straightened(moved, known)
    return Outline(polygon, float(known.mean()), directions, lengths)


def _footprint_contour(points: Array) -> Array:
    import cv2

    low = points[:, :2].min(axis=0) - 4 * CELL_MM
    cell = np.floor((points[:, :2] - low) / CELL_MM).astype(np.int64)
    shape = cell.max(axis=0) + 5
    count = np.bincount(cell[:, 0] * shape[1] + cell[:, 1], minlength=int(shape.prod())).reshape(shape)
    typical = float(np.median(count[count > 0]))
    solid = (count >= max(1.0, 0.15 * typical)).astype(np.uint8)
    solid = cv2.morphologyEx(solid, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    solid = cv2.morphologyEx(solid, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
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


def straightened(loop: Array, known: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Replace runs that are straight within the noise by fitted lines and meet neighbours in sharp corners."""
    import cv2

    corners = cv2.approxPolyDP(loop.astype(np.float32)[:, None], 1.0, True)[:, 0]
    starts = sorted(int(np.argmin(np.linalg.norm(loop - c, axis=1))) for c in corners)
    sides = []
    for begin, end in pairwise([*starts, starts[0] + len(loop)]):
        index = np.arange(begin, end + 1) % len(loop)
        sides.append((index, _fit_line(loop[index], known[index])))
    pieces: list[Any] = []
    for k, (index, line) in enumerate(sides):
        before, after = sides[k - 1][1], sides[(k + 1) % len(sides)][1]
        if line is None:
            pieces.append(loop[index[1:-1]])
            continue
        first = _meeting(before, line) if before is not None else _foot(line, loop[index[0]])
        last = _meeting(line, after) if after is not None else _foot(line, loop[index[-1]])
        pieces.append(np.stack([first, last]))
    straight = [(line, len(index) * SPACING_MM) for index, line in sides if line is not None]
    directions = np.array([np.degrees(np.arctan2(line[3], line[2])) for line, _ in straight])
    return _without_repeats(np.concatenate(pieces)), directions, np.array([length for _, length in straight])


def _without_repeats(loop: Array) -> Array:
    keep = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1) > 1e-6
    return np.asarray(loop[keep])


def _fit_line(points: Array, known: NDArray[np.bool_]) -> Array | None:
    """Return (4,) a point and a unit direction of a robust line, or None when the run is not straight."""
    length = (len(points) - 1) * SPACING_MM
    if length < STRAIGHT_MIN_MM:
        return None
    trim = int(min(6.0, length / 5) / SPACING_MM)
    middle = points[trim : len(points) - trim]
    weight = np.where(known[trim : len(points) - trim], 1.0, 0.1)
    centre, direction, residual = middle.mean(axis=0), middle[-1] - middle[0], np.zeros(len(middle))
    for _ in range(5):
        centre = np.average(middle, axis=0, weights=weight)
        offset = middle - centre
        _, vectors = np.linalg.eigh((offset * weight[:, None]).T @ offset)
        direction = vectors[:, 1] * np.sign(vectors[:, 1] @ (middle[-1] - middle[0]))
        residual = offset @ np.array([-direction[1], direction[0]])
        scale = max(0.05, 1.4826 * float(np.median(np.abs(residual))))
        weight = np.where(known[trim : len(points) - trim], 1.0, 0.1)
        weight = weight * np.clip(1 - (residual / (4.685 * scale)) ** 2, 0, None) ** 2 + 1e-9
    if float(np.sqrt(np.average(residual**2, weights=weight))) > STRAIGHT_RMS_MM:
        return None
    return np.concatenate([centre, direction])


def _meeting(a: Array, b: Array) -> Array:
    cross = a[2] * b[3] - a[3] * b[2]
    if abs(cross) < 0.2:
        return np.asarray((a[:2] + b[:2]) / 2)
    reach = ((b[0] - a[0]) * b[3] - (b[1] - a[1]) * b[2]) / cross
    return np.asarray(a[:2] + reach * a[2:])


def _foot(line: Array, point: Array) -> Array:
    return np.asarray(line[:2] + ((point - line[:2]) @ line[2:]) * line[2:])
