"""Strokes and probe poses put together as a plan in visiting order."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.plan import APPROACH, SCAN, Coverage, ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.planning.probe_pose import Stance, frames_of
from eddyscan.planning.route import AroundLinks, LevelLinks, Route, routed
from eddyscan.planning.strokes import Stroke
from eddyscan.planning.timing import MotionLimits, arrival_times


def route_through(strokes: list[Stroke], stance: Stance, links: LevelLinks | AroundLinks) -> Route:
    """Return the way through all strokes in the given order."""
    begin = np.cumsum([0, *(len(stroke.points) for stroke in strokes)])
    rows = [np.arange(lo, hi) for lo, hi in pairwise(begin.tolist())]
    return routed(rows, stance.face_mm, stance.axis, links)


def assembled(
    strokes: list[Stroke], stance: Stance, route: Route, technique: Technique, motion: MotionLimits
) -> dict[str, Any]:
    """Return the arrays of a `ScanPlan` by name."""
    scan, n = route.kind == SCAN, len(route.kind)
    at = route.reading[scan]
    points, normals, s = (np.concatenate([getattr(k, name) for k in strokes]) for name in ("points", "normals", "s_mm"))
    s_mm, tilt, normal = np.zeros(n), np.zeros(n), -route.axis
    lift = np.full(n, technique.scan.clearance_mm + technique.scan.lift_off_mm)
    s_mm[scan], lift[scan], tilt[scan], normal[scan] = s[at], stance.lift_off_mm[at], stance.tilt_deg[at], normals[at]
    spots = route.face_mm - lift[:, None] * normal
    spots[scan] = points[at]
    speed = _speeds(route, technique)
    return {
        "kind": route.kind.astype(np.int64),
        "row": route.row.astype(np.int64),
        "point": route.point.astype(np.int64),
        "s_mm": s_mm,
        "surface_mm": spots,
        "normal": normal,
        "T_part_probe": frames_of(route.face_mm, route.axis, _travel(route)),
        "tilt_deg": tilt,
        "lift_off_mm": lift,
        "speed_mm_s": speed,
        "time_s": arrival_times(route.face_mm, speed, scan, technique.scan, motion),
    }


def plan_of(arrays: dict[str, Any], coverage: Coverage, technique: Technique, **told: Any) -> ScanPlan:
    """Return the plan; `told` are its inputs and notes."""
    settings = technique.model_dump(mode="json", include={"plan", "probe", "scan"})
    return ScanPlan(**arrays, coverage=coverage, settings=settings, **told)


def _speeds(route: Route, technique: Technique) -> Array:
    """Return the speed (N,) on the way to each pose: slow towards the part, else the scan's."""
    speed = np.full(len(route.kind), technique.scan.speed_mm_s)
    down = np.flatnonzero(route.kind == APPROACH)
    speed[down] = technique.scan.approach_speed_mm_s
    speed[down + 1] = technique.scan.approach_speed_mm_s
    return speed


def _travel(route: Route) -> Array:
    """Return the direction of travel (N, 3) at each pose; ends of rows take their inner neighbour's."""
    forward = np.diff(route.face_mm, axis=0, append=route.face_mm[-1:])
    backward = np.diff(route.face_mm, axis=0, prepend=route.face_mm[:1])
    scan = route.kind == SCAN
    same_after = np.append(scan[1:] & scan[:-1] & (route.row[1:] == route.row[:-1]), False)
    same_before = np.append(False, same_after[:-1])
    travel = forward * same_after[:, None] + backward * same_before[:, None]
    alone = ~(same_after | same_before)
    travel[alone] = forward[alone]
    return np.asarray(travel)
