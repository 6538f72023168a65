"""From a surface and a technique to a plan."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from eddyscan.core.errors import CoverageError, GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors
from eddyscan.core.plan import APPROACH, SCAN, Coverage, ScanPlan, Uncovered
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.planning.heights import height_map
from eddyscan.planning.order import boustrophedon
from eddyscan.planning.probe_pose import Stance, frames_of, normal_stance, vertical_stance
from eddyscan.planning.region import (
    Patch,
    border_distance,
    faces_seen_from_above,
    patches_of,
    steepest_tilt_deg,
    travel_guard,
)
from eddyscan.planning.route import AroundLinks, LevelLinks, Route, routed
from eddyscan.planning.smooth import SmoothSurface, smoothed
from eddyscan.planning.strategies import lines_for
from eddyscan.planning.strokes import Stroke, stroke_from_line
from eddyscan.planning.timing import MotionLimits, arrival_times
from eddyscan.planning.verify import dense_samples, distance_to_strokes, row_distances, spacings

CRUMB_OF_PART = 0.002


@dataclass(frozen=True)
class PlannedPatch:
    """A patch with its smooth surface, its strokes and what of it may be scanned."""

    surface: SmoothSurface
    strokes: list[Stroke]
    edge_mm: Array
    reach_mm: Array


def plan(
    mesh: SurfaceMesh,
    technique: Technique,
    *,
    travel_mm: tuple[float, float, float] | None = None,
    inputs: dict[str, str] | None = None,
    allow_gaps: bool = False,
    motion: MotionLimits | None = None,
    progress: Progress = silent,
) -> ScanPlan:
    """Plan the scan of a surface.

    Parameters
    ----------
    mesh : SurfaceMesh [mm, part frame]
    technique : Technique
    travel_mm : (3,), optional
        Spans of the axes; parts outside are left out and listed.
    inputs : dict, optional
        Name -> SHA-256 of what the plan is made from.
    allow_gaps : bool
        Return a plan that misses the technique's coverage instead of refusing it.
    motion : MotionLimits, optional
        Axis speeds and accelerations for the planned times.

    Returns
    -------
    plan : ScanPlan [mm, part frame]

    Raises
    ------
    GeometryError
        When the mesh cannot be planned on, or nothing is left inside the margin.
    CoverageError
        When less than `technique.plan.coverage_min` of the region is swept.
    """
    settings = technique.plan
    progress("planning", 0, 4)
    patches, left_out = _patches(mesh, technique)
    planned = [_planned(patch, mesh, technique, travel_mm) for patch in patches]
    planned = [p for p in planned if p.strokes]
    if not planned:
        raise GeometryError(
            f"nothing is left to scan: margin {settings.margin_mm:g} mm, pitch {settings.pitch_mm:g} mm on a surface "
            f"of {mesh.area_mm2:.0f} mm^2. Lower the margin or the pitch."
        )
    progress("planning", 2, 4)
    strokes = [stroke for p in planned for stroke in boustrophedon(p.strokes)]
    coverage = _coverage(planned, strokes, technique, left_out)
    if coverage.swept < settings.coverage_min and not allow_gaps:
        raise CoverageError(
            f"the plan sweeps {100 * coverage.swept:.1f} % of the region inside the {settings.margin_mm:g} mm margin, "
            f"the technique demands {100 * settings.coverage_min:.1f} %; the largest gap is "
            f"{coverage.largest_gap_mm:.1f} mm from the path. Use a smaller pitch, another strategy, or allow gaps."
        )
    progress("planning", 3, 4)
    result = _assembled(mesh, strokes, technique, coverage, inputs or {}, motion or MotionLimits())
    progress("planning", 4, 4)
    return result


def _patches(mesh: SurfaceMesh, technique: Technique) -> tuple[list[Patch], list[Uncovered]]:
    seen = np.ones(len(mesh.faces), dtype=bool)
    left_out = []
    area = 0.5 * np.linalg.norm(face_vectors(mesh.vertices, mesh.faces), axis=1)
    if technique.plan.machine == "xyz":
        tilt = steepest_tilt_deg(technique.probe, technique.analysis.lift_off_max_mm)
        seen = faces_seen_from_above(mesh.vertices, mesh.faces, tilt)
        if (~seen).any():
            left_out.append(Uncovered(f"steeper than {tilt:.0f} deg for a vertical probe", float(area[~seen].sum())))
    return patches_of(mesh.vertices, mesh.faces[seen], least_mm2=CRUMB_OF_PART * float(area.sum())), left_out


def _planned(
    patch: Patch, mesh: SurfaceMesh, technique: Technique, travel_mm: tuple[float, float, float] | None
) -> PlannedPatch:
    settings = technique.plan
    surface = smoothed(patch.vertices, patch.faces, settings.pitch_mm)
    edge_mm = border_distance(patch)
    headroom = technique.scan.clearance_mm + technique.scan.lift_off_mm
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    reach_mm = travel_guard(np.concatenate([surface.vertices, [low, high]]), travel_mm, headroom)[:-2]
    guard = np.minimum(edge_mm - settings.margin_mm, reach_mm) if settings.margin_mm > 0 else reach_mm
    guard = np.minimum(guard, 1e6)
    lines = lines_for(surface, settings, guard)
    strokes = [stroke_from_line(line, surface, settings.step_mm) for line in lines]
    return PlannedPatch(surface, [stroke for stroke in strokes if stroke is not None], edge_mm, reach_mm)


def _coverage(
    planned: list[PlannedPatch], strokes: list[Stroke], technique: Technique, left_out: list[Uncovered]
) -> Coverage:
    footprint, margin = technique.plan.pitch_mm, technique.plan.margin_mm
    far, area_of, edge_mm2, reach_mm2 = [], [], 0.0, 0.0
    for p in planned:
        s = dense_samples(p.surface.vertices, p.surface.faces, p.surface.normals, footprint)
        weight = p.surface.barycentric(s.points, s.face)
        corners = p.surface.faces[s.face]
        edge = np.einsum("nk,nk->n", weight, np.minimum(p.edge_mm, 1e6)[corners])
        reach = np.einsum("nk,nk->n", weight, np.minimum(p.reach_mm, 1e6)[corners])
        in_margin = edge >= margin if margin > 0 else np.ones(len(edge), dtype=bool)
        edge_mm2 += float((~in_margin).sum()) * s.area_mm2
        reach_mm2 += float((in_margin & (reach <= 0)).sum()) * s.area_mm2
        distance = distance_to_strokes(s, strokes, footprint / 8)[in_margin & (reach > 0)]
        far.append(distance)
        area_of.append(np.full(len(distance), s.area_mm2))
    distance, area = np.concatenate(far), np.concatenate(area_of)
    missed = distance > footprint / 2 * (1 + 1e-3)
    lost_mm2 = float(area[missed].sum())
    uncovered = list(left_out)
    if edge_mm2 > 0:
        uncovered.append(Uncovered(f"edge zone of {margin:g} mm", edge_mm2))
    if reach_mm2 > 0:
        uncovered.append(Uncovered("out of reach of the axes", reach_mm2))
    if lost_mm2 > 0:
        uncovered.append(Uncovered("between or beyond rows", lost_mm2))
    space, rows = spacings(strokes), row_distances(strokes, technique.plan.pitch_mm)
    return Coverage(
        swept=1 - lost_mm2 / max(float(area.sum()), 1e-12),
        largest_gap_mm=float(distance.max()),
        spacing_mm=_three(space),
        row_distance_mm=_three(rows),
        footprint_mm=footprint,
        uncovered=tuple(uncovered),
    )


def _three(values: Array) -> tuple[float, float, float]:
    if values.size == 0:
        return (0.0, 0.0, 0.0)
    return (float(values.min()), float(values.mean()), float(values.max()))


def _assembled(
    mesh: SurfaceMesh,
    strokes: list[Stroke],
    technique: Technique,
    coverage: Coverage,
    inputs: dict[str, str],
    motion: MotionLimits,
) -> ScanPlan:
    points, normals = (np.concatenate([getattr(s, name) for s in strokes]) for name in ("points", "normals"))
    stance, links = _stance(mesh, points, normals, technique)
    begin = np.cumsum([0, *(len(s.points) for s in strokes)])
    rows = [np.arange(lo, hi) for lo, hi in pairwise(begin.tolist())]
    route = routed(rows, stance.face_mm, stance.axis, links)
    scan = route.kind == SCAN
    at = route.reading[scan]
    n = len(route.kind)
    s_mm, lift, tilt, normal = np.zeros(n), np.zeros(n), np.zeros(n), -route.axis
    s_mm[scan] = np.concatenate([s.s_mm for s in strokes])[at]
    lift[scan], tilt[scan], normal[scan] = stance.lift_off_mm[at], stance.tilt_deg[at], normals[at]
    lift[~scan] = technique.scan.clearance_mm + technique.scan.lift_off_mm
    speed = np.full(n, technique.scan.speed_mm_s)
    speed[route.kind == APPROACH] = technique.scan.approach_speed_mm_s
    down = np.flatnonzero(route.kind == APPROACH) + 1
    speed[down] = technique.scan.approach_speed_mm_s
    return ScanPlan(
        kind=route.kind.astype(np.int64),
        row=route.row.astype(np.int64),
        point=route.point.astype(np.int64),
        s_mm=s_mm,
        surface_mm=_spots(route, normal, lift, points, scan, at),
        normal=normal,
        T_part_probe=frames_of(route.face_mm, route.axis, _travel(route)),
        tilt_deg=tilt,
        lift_off_mm=lift,
        speed_mm_s=speed,
        time_s=arrival_times(route.face_mm, speed, scan, technique.scan.settle_s, motion),
        coverage=coverage,
        settings=technique.model_dump(mode="json", include={"plan", "probe", "scan"}),
        inputs=inputs,
    )


def _spots(route: Route, normal: Array, lift: Array, points: Array, scan: Array, at: Array) -> Array:
    spots = route.face_mm - lift[:, None] * normal
    spots[scan] = points[at]
    return spots


def _stance(
    mesh: SurfaceMesh, points: Array, normals: Array, technique: Technique
) -> tuple[Stance, LevelLinks | AroundLinks]:
    clearance = technique.scan.clearance_mm
    if technique.plan.machine != "xyz":
        return normal_stance(points, normals, technique.scan.lift_off_mm), AroundLinks(
            mesh.vertices, clearance_mm=clearance
        )
    heights = height_map(mesh.vertices, mesh.faces, min(0.5, technique.probe.tip_radius_mm / 4))
    stance = vertical_stance(points, normals, heights, technique.probe, technique.scan.lift_off_mm)
    return stance, LevelLinks(heights, clearance_mm=clearance, body_radius_mm=technique.probe.body_radius_mm)


def _travel(route: Route) -> Array:
    """Return the direction of travel (N, 3) at each pose; ends of rows take their inner neighbour's."""
    forward = np.diff(route.face_mm, axis=0, append=route.face_mm[-1:])
    backward = np.diff(route.face_mm, axis=0, prepend=route.face_mm[:1])
    scan = route.kind == SCAN
    same_after = np.append(scan[1:] & scan[:-1] & (route.row[1:] == route.row[:-1]), False)
    same_before = np.append(False, same_after[:-1])
    travel = forward * same_after[:, None] + backward * same_before[:, None]
    other = ~(same_after | same_before)
    travel[other] = forward[other]
    return np.asarray(travel)
