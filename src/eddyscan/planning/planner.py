"""From a surface and a technique to a plan."""

from __future__ import annotations

import numpy as np

from eddyscan.core.errors import CoverageError, GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors
from eddyscan.core.plan import Coverage, ScanPlan, Uncovered
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.planning.assembly import assembled, plan_of, route_through
from eddyscan.planning.condition import CRUMB_OF_PART, conditioned
from eddyscan.planning.heights import height_map
from eddyscan.planning.order import ordered
from eddyscan.planning.patch_rows import PlannedPatch, planned_patch
from eddyscan.planning.patches import Patch, patches_of
from eddyscan.planning.probe_pose import Stance, normal_stance, vertical_stance
from eddyscan.planning.region import border_distance, faces_seen_from_above, steepest_tilt_deg, travel_guard
from eddyscan.planning.region_guard import Guard, combined, left_out, merged, tilt_guard
from eddyscan.planning.route import AroundLinks, LevelLinks
from eddyscan.planning.smooth import SmoothSurface, smoothed
from eddyscan.planning.strokes import Stroke
from eddyscan.planning.timing import MotionLimits
from eddyscan.planning.topology import edges_of
from eddyscan.planning.verify import row_distances, spacings

# Faces a little steeper than the limit stay, so that rows end at the slope itself, not at a ragged edge of faces.
STEEP_BAND_DEG = 4.5


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
    fit = conditioned(mesh, technique.plan)
    mesh = SurfaceMesh.from_triangles(fit.vertices, fit.faces)
    patches, zones = _patches(mesh, technique)
    if fit.crumbs_mm2:
        zones.append(Uncovered("loose pieces", fit.crumbs_mm2))
    planned: list[PlannedPatch] = []
    for k, whole in enumerate(patches):
        progress("planning rows", k, len(patches))
        patch, split = whole.refined(max(1.5, 0.3 * technique.plan.pitch_mm))
        if split:
            fit.notes.append(f"{split} long edges split so that rows can bend between vertices")
        surface = smoothed(patch.vertices, patch.faces, technique.plan.pitch_mm, spacing_mm=fit.spacing_mm)
        guards = _guards(patch, surface, mesh, technique, travel_mm)
        laid = planned_patch(surface, technique, combined(guards, len(surface.vertices)))
        if laid is not None:
            planned.append(laid)
            zones += left_out(guards, laid.samples, surface)
        else:
            zones.append(Uncovered("inside the margin or out of reach altogether", patch.area_mm2))
    progress("planning rows", len(patches), len(patches))
    if not planned:
        raise _nothing_left(mesh, technique)
    strokes: list[Stroke] = []
    for done in planned:
        strokes += ordered(done.strokes, strokes[-1].points[-1] if strokes else None)
    coverage = _coverage(planned, strokes, technique, zones)
    if not allow_gaps:
        _require(coverage, technique)
    points, normals = (np.concatenate([getattr(s, name) for s in strokes]) for name in ("points", "normals"))
    stance, links = _stance(mesh, points, normals, technique)
    arrays = assembled(strokes, stance, route_through(strokes, stance, links), technique, motion or MotionLimits())
    return plan_of(arrays, coverage, technique, inputs=inputs or {}, notes=tuple(fit.notes))


def _patches(mesh: SurfaceMesh, technique: Technique) -> tuple[list[Patch], list[Uncovered]]:
    seen = np.ones(len(mesh.faces), dtype=bool)
    zones = []
    area = 0.5 * np.linalg.norm(face_vectors(mesh.vertices, mesh.faces), axis=1)
    if technique.plan.machine == "xyz":
        tilt = _steepest(technique)
        seen = faces_seen_from_above(mesh.vertices, mesh.faces, tilt + STEEP_BAND_DEG)
        if (~seen).any():
            zones.append(Uncovered(_steep(tilt), float(area[~seen].sum())))
    elif not edges_of(mesh.faces).count.min() < 2:
        # A closed part in the part frame stands on the table with its flat bottom.
        down = face_vectors(mesh.vertices, mesh.faces)[:, 2] < -1.9 * area
        low = mesh.vertices[mesh.faces, 2].max(axis=1) < mesh.vertices[:, 2].min() + 0.5
        seen = ~(down & low)
        if (~seen).any():
            zones.append(Uncovered("stands on the table", float(area[~seen].sum())))
    least = CRUMB_OF_PART * float(area.sum())
    patches = patches_of(mesh.vertices, mesh.faces, seen, least_mm2=least)
    if not patches:
        raise GeometryError(
            f"no piece of the surface can be scanned: of {area.sum():.0f} mm^2, {area[seen].sum():.0f} mm^2 face the "
            f"probe, none of it a connected piece over {least:.1f} mm^2. Check the mesh, or use another machine."
        )
    return patches, zones


def _steepest(technique: Technique) -> float:
    return steepest_tilt_deg(technique.probe, technique.analysis.lift_off_max_mm)


def _steep(tilt_deg: float) -> str:
    return f"steeper than {tilt_deg:.0f} deg for a vertical probe"


def _guards(
    patch: Patch,
    surface: SmoothSurface,
    mesh: SurfaceMesh,
    technique: Technique,
    travel_mm: tuple[float, float, float] | None,
) -> list[Guard]:
    margin = technique.plan.margin_mm
    guards = []
    if margin > 0:
        guards.append(Guard(f"edge zone of {margin:g} mm", border_distance(patch) - margin))
    if technique.plan.machine == "xyz":
        tilt = _steepest(technique)
        guards.append(Guard(_steep(tilt), tilt_guard(surface, tilt)))
    if travel_mm is not None:
        headroom = technique.scan.clearance_mm + technique.scan.lift_off_mm
        box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        reach = travel_guard(np.concatenate([surface.vertices, box]), travel_mm, headroom)[:-2]
        guards.append(Guard("out of reach of the axes", reach))
    return guards


def _nothing_left(mesh: SurfaceMesh, technique: Technique) -> GeometryError:
    settings = technique.plan
    return GeometryError(
        f"nothing is left to scan: margin {settings.margin_mm:g} mm, pitch {settings.pitch_mm:g} mm on a surface "
        f"of {mesh.area_mm2:.0f} mm^2. Lower the margin or the pitch."
    )


def _require(coverage: Coverage, technique: Technique) -> None:
    settings = technique.plan
    if coverage.swept < settings.coverage_min:
        raise CoverageError(
            f"the plan sweeps {100 * coverage.swept:.1f} % of the region inside the {settings.margin_mm:g} mm margin, "
            f"the technique demands {100 * settings.coverage_min:.1f} %; the largest gap is "
            f"{coverage.largest_gap_mm:.1f} mm from the path. Use a smaller pitch, another strategy, or allow gaps."
        )


def _coverage(
    planned: list[PlannedPatch], strokes: list[Stroke], technique: Technique, zones: list[Uncovered]
) -> Coverage:
    footprint = technique.plan.pitch_mm
    inside_mm2 = sum(float(p.inside.sum()) * p.samples.area_mm2 for p in planned)
    zones = list(zones)
    for p in planned:
        lost = p.inside & (p.distance_mm > p.samples.reach_mm)
        if lost.any():
            worst = int(np.argmax(np.where(lost, p.distance_mm, 0)))
            centre = tuple(np.round(p.samples.points[worst], 3).tolist())
            zones.append(Uncovered("between or beyond rows", float(lost.sum()) * p.samples.area_mm2, centre))
    missed = sum(zone.area_mm2 for zone in zones if zone.reason == "between or beyond rows")
    return Coverage(
        swept=1 - missed / max(inside_mm2, 1e-12),
        largest_gap_mm=max(p.widest_mm for p in planned),
        spacing_mm=_three(spacings(strokes)),
        row_distance_mm=_three(row_distances(strokes, footprint)),
        footprint_mm=footprint,
        uncovered=merged(zones),
    )


def _three(values: Array) -> tuple[float, float, float]:
    if values.size == 0:
        return (0.0, 0.0, 0.0)
    return (float(values.min()), float(values.mean()), float(values.max()))


def _stance(
    mesh: SurfaceMesh, points: Array, normals: Array, technique: Technique
) -> tuple[Stance, LevelLinks | AroundLinks]:
    clearance, probe = technique.scan.clearance_mm, technique.probe
    if technique.plan.machine != "xyz":
        stance = normal_stance(points, normals, technique.scan.lift_off_mm)
        return stance, AroundLinks(mesh.vertices, clearance_mm=clearance)
    heights = height_map(mesh.vertices, mesh.faces, min(0.5, probe.tip_radius_mm / 4))
    stance = vertical_stance(points, normals, heights, probe, technique.scan.lift_off_mm)
    return stance, LevelLinks(heights, clearance_mm=clearance, body_radius_mm=probe.body_radius_mm)
