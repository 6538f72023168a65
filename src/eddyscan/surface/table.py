"""The plane the part stands on, seen in each view: it fixes height, roll and pitch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array, apply, from_rotation_vector, transform
from eddyscan.surface.surfels import SurfelImage
from eddyscan.surface.view import View

SAMPLE = 4000
HYPOTHESES = 300
FIT_POINTS = 40_000
TOLERANCE_SHARE = 0.004  # of the median distance
MIN_SHARE = 0.08  # of the view's surfels that must lie on the table
LEVEL_STRIDE = 7
LEVEL_BAND_MM = 2.0
LEVEL_RADIUS_MM = 120.0
BELOW_LIMIT = 0.05  # share that may lie below it: nothing hangs under a table


@dataclass(frozen=True)
class TablePlane:
    """Where the table is in one view.

    Attributes
    ----------
    T_table_camera : (4, 4) z = 0 is the table, z up; the origin is where the optical axis meets it
    rms_mm : float
        Of the inliers along the normal.
    share : float
        Of the view's surfels that lie on it.
    """

    T_table_camera: Array
    rms_mm: float
    share: float


def find_table(image: SurfelImage, name: str, *, seed: int = 0) -> TablePlane:
    """Find the table plane by RANSAC with oriented votes, then a robust least-squares fit.

    Raises
    ------
    RegistrationError
        When no plane carries enough of the view with (almost) nothing below it.
    """
    return table_in(image.points[image.valid].astype(np.float64), name, seed=seed)


def table_in(points: Array, name: str, *, seed: int = 0) -> TablePlane:
    """Find the table among points (N, 3) [mm] seen from the origin; see `find_table`."""
    if len(points) < 500:
        raise RegistrationError(
            f"{name} has {len(points)} usable surface points (need 500): the range gate, the cleaning or the camera "
            "left almost nothing. Check range_min_mm, range_max_mm and the depth scale."
        )
    rng = np.random.default_rng(seed)
    reach = np.linalg.norm(points, axis=1)
    area = reach**2
    pick = rng.choice(len(points), size=min(SAMPLE, len(points)), p=area / area.sum())
    tolerance = TOLERANCE_SHARE * float(np.median(reach))
    plane = _best_plane(points[pick], tolerance, rng)
    every = slice(None, None, max(1, len(points) // FIT_POINTS))
    plane, share, below, rms = _refined(points[every], area[every] / area[every].sum(), plane, tolerance)
    if share < MIN_SHARE or below > BELOW_LIMIT:
        raise RegistrationError(
            f"no table visible in {name}: its largest plane carries {100 * share:.0f} % of the view (need "
            f"{100 * MIN_SHARE:.0f} %) with {100 * below:.0f} % of it below (limit {100 * BELOW_LIMIT:.0f} %). "
            "Show more of the table, widen range_max_mm, or give the camera poses."
        )
    return TablePlane(_table_frame(plane), rms, share)


def _best_plane(points: Array, tolerance: float, rng: np.random.Generator) -> Array:
    """Return (4,) n, d with n.p + d = height above the plane, n towards the camera."""
    trio = points[rng.integers(0, len(points), (HYPOTHESES, 3))]
    n = np.cross(trio[:, 1] - trio[:, 0], trio[:, 2] - trio[:, 0])
    length = np.linalg.norm(n, axis=1)
    keep = length > 1.0
    n, origin = n[keep] / length[keep, None], trio[keep, 0]
    d = -(n * origin).sum(axis=1)
    n, d = n * np.sign(d)[:, None], np.abs(d)
    height = n @ points.T + d[:, None]
    votes = (np.abs(height) < tolerance).sum(axis=1) - 2.0 * (height < -4 * tolerance).sum(axis=1)
    best = int(np.argmax(votes))
    return np.array([*n[best], d[best]])


def _refined(points: Array, area: Array, plane: Array, tolerance: float) -> tuple[Array, float, float, float]:
    scale = tolerance
    for _ in range(6):
        height = points @ plane[:3] + plane[3]
        near = np.abs(height) < 3 * scale
        if near.sum() < 50:
            break
        weight = area[near] * (1 - (height[near] / (3 * scale)) ** 2) ** 2
        centre = (weight[:, None] * points[near]).sum(axis=0) / weight.sum()
        offset = points[near] - centre
        _, vectors = np.linalg.eigh((offset * weight[:, None]).T @ offset)
        n = vectors[:, 0] * (1.0 if centre @ vectors[:, 0] < 0 else -1.0)
        plane = np.array([*n, -n @ centre])
        height = points @ plane[:3] + plane[3]
        spread = 1.4826 * float(np.median(np.abs(height[np.abs(height) < 3 * scale])))
        scale = min(tolerance, max(1.5 * spread, tolerance / 8))
    on = np.abs(height) < tolerance
    rms = float(np.sqrt(np.mean(height[on] ** 2))) if on.any() else np.inf
    return plane, float(area[on].sum()), float(area[height < -4 * tolerance].sum()), rms


def _table_frame(plane: Array) -> Array:
    """Return T_table_camera with z along the plane's normal and x along the image's columns."""
    n, d = plane[:3], plane[3]
    x = np.array([1.0, 0.0, 0.0]) - n[0] * n
    if np.linalg.norm(x) < 0.1:
        x = np.array([0.0, 1.0, 0.0]) - n[1] * n
    x /= np.linalg.norm(x)
    rotation: NDArray[np.float64] = np.stack([x, np.cross(n, x), n])
    hit = np.array([0.0, 0.0, 1.0]) * (-d / n[2]) if n[2] < -0.05 else -d * n
    return transform(rotation, -rotation @ hit)


def level_table(views: Sequence[View], centre: Array) -> Array:
    """Return the small (4, 4) correction that puts the table of all views together on z = 0.

    Each view's own plane carries that view's calibration error; together they
    average. Table surfels count by their distance to `centre` (3,) [mm].
    """
    pieces = []
    for view in views:
        points = apply(view.T_world_camera, view.surfels.points[view.surfels.valid][::LEVEL_STRIDE].astype(np.float64))
        pieces.append(points[np.abs(points[:, 2]) < LEVEL_BAND_MM])
    points = np.concatenate(pieces)
    if len(points) < 100:
        return np.eye(4)
    offset = points[:, :2] - centre[:2]
    near = np.exp(-0.5 * (offset**2).sum(axis=1) / LEVEL_RADIUS_MM**2)
    rows = np.column_stack([offset, np.ones(len(points))])
    plane, residual = np.zeros(3), points[:, 2]
    for _ in range(6):
        scale = max(0.05, 1.4826 * float(np.median(np.abs(residual))))
        weight = near * np.clip(1 - (residual / (4.685 * scale)) ** 2, 0, None) ** 2
        plane = np.linalg.solve(rows.T @ (weight[:, None] * rows) + 1e-9 * np.eye(3), rows.T @ (weight * points[:, 2]))
        residual = points[:, 2] - rows @ plane
    tilt = np.array([plane[1], -plane[0], 0.0])  # turning about x by b takes z = b y to zero, and so on
    small = from_rotation_vector(-tilt, np.zeros(3))
    pivot = np.array([centre[0], centre[1], plane[2]])
    small[:3, 3] = np.array([centre[0], centre[1], 0.0]) - small[:3, :3] @ pivot
    return small
