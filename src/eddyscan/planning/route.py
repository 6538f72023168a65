"""The whole way of the probe: safe approach, rows, links at clearance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.plan import APPROACH, LINK, SCAN
from eddyscan.planning.heights import HeightMap

ARC_STEP_RAD = np.radians(20.0)


@dataclass(frozen=True)
class Route:
    """Every pose in visiting order.

    Attributes
    ----------
    kind, row, point : (N,) int64, as in `ScanPlan`
    face_mm : (N, 3) coil face centres, axis : (N, 3) unit, into the part
    reading : (N,) int64, number of the reading at scan poses, -1 elsewhere
    """

    kind: IntArray
    row: IntArray
    point: IntArray
    face_mm: Array
    axis: Array
    reading: IntArray


class LevelLinks:
    """Links of a vertical probe: up, across above everything in the way, down."""

    def __init__(self, heights: HeightMap, *, clearance_mm: float, body_radius_mm: float) -> None:
        self.heights, self.clearance_mm, self.reach_mm = heights, clearance_mm, body_radius_mm
        self.top_mm = float(heights.z_mm.max()) + clearance_mm

    def lifted(self, face: Array, axis: Array) -> Array:
        return face - self.clearance_mm * axis

    def across(self, start: Array, end: Array, _axes: tuple[Array, Array]) -> list[tuple[Array, Array]]:
        """Return the poses between two lifted positions (3,)."""
        down = np.array([0.0, 0.0, -1.0])
        n = max(2, int(np.ceil(np.linalg.norm(end[:2] - start[:2]) / 1.0)) + 1)
        line = start[:2] + np.linspace(0, 1, n)[:, None] * (end[:2] - start[:2])
        wide = self.reach_mm * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        spots = (line[:, None] + wide).reshape(-1, 2)
        z = max(float(self.heights.at(spots[:, 0], spots[:, 1]).max()) + self.clearance_mm, start[2], end[2])
        poses = [np.array([*p[:2], z]) for p, own in ((start, start[2]), (end, end[2])) if z > own + 1e-6]
        return [(p, down) for p in poses]

    def away(self, face: Array, axis: Array) -> tuple[Array, Array]:
        """Return a pose above everything, over a position (3,)."""
        return np.array([*face[:2], max(self.top_mm, face[2])]), np.array([0.0, 0.0, -1.0])


class AroundLinks:
    """Links of a probe that tilts: back along its axis, straight when free, else around the part."""

    def __init__(self, vertices: Array, *, clearance_mm: float) -> None:
        self.tree, self.clearance_mm = KDTree(vertices), clearance_mm
        self.centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self.radius_mm = float(np.linalg.norm(vertices - self.centre, axis=1).max()) + 2 * clearance_mm

    def lifted(self, face: Array, axis: Array) -> Array:
        return face - self.clearance_mm * axis

    def across(self, start: Array, end: Array, axes: tuple[Array, Array]) -> list[tuple[Array, Array]]:
        """Return the poses between two lifted positions (3,)."""
        n = max(2, int(np.ceil(np.linalg.norm(end - start) / (self.clearance_mm / 4))) + 1)
        line = start + np.linspace(0, 1, n)[:, None] * (end - start)
        if np.min(self.tree.query(line)[0]) > 0.6 * self.clearance_mm and axes[0] @ axes[1] > -0.5:
            return []
        return self._around(start, end)

    def _around(self, start: Array, end: Array) -> list[tuple[Array, Array]]:
        a, b = ((p - self.centre) / max(np.linalg.norm(p - self.centre), 1e-9) for p in (start, end))
        angle = float(np.arccos(np.clip(a @ b, -1, 1)))
        if angle > np.pi - 1e-3:
            spare = np.array([0.0, 0.0, 1.0]) if abs(a[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
            middle = spare - (spare @ a) * a
            middle /= np.linalg.norm(middle)
            ways = [a, *_arc(a, middle), *_arc(middle, b), b]
        else:
            ways = [a, *_arc(a, b), b]
        return [(self.centre + self.radius_mm * w, -w) for w in ways]

    def away(self, face: Array, axis: Array) -> tuple[Array, Array]:
        """Return a pose outside the part's sphere, on the way out of a position (3,)."""
        out = (face - self.centre) / max(float(np.linalg.norm(face - self.centre)), 1e-9)
        return self.centre + self.radius_mm * out, -out


def _arc(a: Array, b: Array) -> list[Array]:
    angle = float(np.arccos(np.clip(a @ b, -1, 1)))
    n = int(np.ceil(angle / ARC_STEP_RAD))
    inner = np.arange(1, n) / max(n, 1)
    return [(np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / max(np.sin(angle), 1e-9) for t in inner]


def routed(rows: list[IntArray], face_mm: Array, axis: Array, links: LevelLinks | AroundLinks) -> Route:
    """Return the way through rows of readings.

    Parameters
    ----------
    rows : list of (n,) int64
        Numbers of the readings of each row in running order.
    face_mm, axis : (N, 3) of every reading
    """
    kind, row, point, where, towards, reading = [], [], [], [], [], []

    def add(which: int, r: int, p: Array, a: Array) -> None:
        kind.append(np.array([which]))
        row.append(np.array([r]))
        point.append(np.array([-1]))
        reading.append(np.array([-1]))
        where.append(p[None])
        towards.append(a[None])

    for r, numbers in enumerate(rows):
        first, last = numbers[0], numbers[-1]
        start = links.lifted(face_mm[first], axis[first])
        if r == 0:
            add(LINK, r, *links.away(start, axis[first]))
        else:
            before = rows[r - 1][-1]
            end = links.lifted(face_mm[before], axis[before])
            add(LINK, r, end, axis[before])
            for p, a in links.across(end, start, (axis[before], axis[first])):
                add(LINK, r, p, a)
        add(APPROACH, r, start, axis[first])
        n = len(numbers)
        kind.append(np.full(n, SCAN))
        row.append(np.full(n, r))
        point.append(np.arange(n))
        reading.append(numbers)
        where.append(face_mm[numbers])
        towards.append(axis[numbers])
        if r == len(rows) - 1:
            add(LINK, r, links.lifted(face_mm[last], axis[last]), axis[last])
            add(LINK, r, *links.away(face_mm[last], axis[last]))
    return Route(*(np.concatenate(part) for part in (kind, row, point, where, towards, reading)))
