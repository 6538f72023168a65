"""From a surface and a technique to a plan."""

from __future__ import annotations

import numpy as np

from eddyscan.core.errors import CoverageError, GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import Coverage, ScanPlan, Uncovered
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.planning.assembly import assembled, plan_of, route_through
from eddyscan.planning.condition import conditioned
from eddyscan.planning.order import ordered
from eddyscan.planning.patch_rows import PlannedPatch, planned_patch
from eddyscan.planning.region_guard import combined, left_out, merged, zone_of
from eddyscan.planning.setting import Setting, setting_of
from eddyscan.planning.smooth import smoothed
from eddyscan.planning.strokes import Stroke
from eddyscan.planning.timing import MotionLimits
from eddyscan.planning.verify import row_distances, spacings

ROUGH_MM = 0.02
BETWEEN_ROWS = "between or beyond rows"


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
    notes = list(fit.notes)
    setting = setting_of(SurfaceMesh.from_triangles(fit.vertices, fit.faces), technique, travel_mm)
    planned, zones = _rows(setting, fit.spacing_mm, notes, progress)
    if fit.crumbs_mm2:
        zones.append(Uncovered("loose pieces", fit.crumbs_mm2))
    strokes: list[Stroke] = []
    for patch in planned:
        strokes += ordered(patch.strokes, strokes[-1].points[-1] if strokes else None)
    coverage = _coverage(planned, strokes, technique, zones)
    if not allow_gaps:
        _require(coverage, technique)
    points, normals = (np.concatenate([getattr(s, name) for s in strokes]) for name in ("points", "normals"))
    stance = setting.stance(points, normals)
    arrays = assembled(
        strokes, stance, route_through(strokes, stance, setting.links()), technique, motion or MotionLimits()
    )
    return plan_of(arrays, coverage, technique, inputs=inputs or {}, notes=tuple(notes))


def _rows(
    setting: Setting, spacing_mm: float, notes: list[str], progress: Progress
) -> tuple[list[PlannedPatch], list[Uncovered]]:
    """Return the rows of every patch, and the zones left out with their reasons."""
    pitch = setting.technique.plan.pitch_mm
    # The field of a coil reaches about a millimetre beyond it: wider fits would bridge what it sees.
    footprint = min(pitch, 2 * setting.technique.probe.outer_radius_mm + 2.0)
    patches, zones = setting.patches()
    access = setting.access()
    planned, split_edges = [], 0
    for k, whole in enumerate(patches):
        progress("planning rows", k, len(patches))
        patch, split = whole.refined(max(1.5, 0.3 * pitch))
        split_edges += split
        surface = smoothed(patch.vertices, patch.faces, footprint, spacing_mm=spacing_mm)
        guards = setting.guards(patch, surface)
        laid = planned_patch(surface, setting.technique, combined(guards, len(surface.vertices)), access)
        if laid is None:
            zones.append(Uncovered("inside the margin or out of reach altogether", patch.area_mm2))
            continue
        planned.append(laid)
        zones += left_out(guards, laid.samples, surface)
        if laid.blocked.any():
            zones.append(zone_of(access.reason, laid.samples, laid.blocked))
        wide_mm = 2 * surface.radius_mm
        if surface.noise_mm > ROUGH_MM and wide_mm > 1.2 * pitch:
            notes.append(f"the mesh is rough by {surface.noise_mm:.2f} mm: normals are fitted {wide_mm:.1f} mm wide")
    progress("planning rows", len(patches), len(patches))
    if split_edges:
        notes.append(f"{split_edges} long edges split so that rows can bend between vertices")
    if not planned:
        raise _nothing_left(setting, zones)
    return planned, zones


def _nothing_left(setting: Setting, zones: list[Uncovered]) -> GeometryError:
    settings = setting.technique.plan
    why = "; ".join(f"{zone.reason}: {zone.area_mm2:.0f} mm^2" for zone in merged(zones))
    return GeometryError(
        f"nothing is left to scan: margin {settings.margin_mm:g} mm, pitch {settings.pitch_mm:g} mm on a surface "
        f"of {setting.mesh.area_mm2:.0f} mm^2 ({why}). Lower the margin or the pitch, or use another machine."
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
    region_mm2, missed_mm2, zones = 0.0, 0.0, list(zones)
    for patch in planned:
        region_mm2 += float(patch.inside.sum()) * patch.samples.area_mm2
        lost = patch.inside & (patch.distance_mm > patch.samples.reach_mm)
        if lost.any():
            missed_mm2 += float(lost.sum()) * patch.samples.area_mm2
            zones.append(zone_of(BETWEEN_ROWS, patch.samples, lost))
    return Coverage(
        swept=1 - missed_mm2 / max(region_mm2, 1e-12),
        largest_gap_mm=max(patch.widest_mm for patch in planned),
        spacing_mm=_three(spacings(strokes)),
        row_distance_mm=_three(row_distances(strokes, technique.plan.pitch_mm)),
        footprint_mm=technique.plan.pitch_mm,
        uncovered=merged(zones),
    )


def _three(values: Array) -> tuple[float, float, float]:
    if values.size == 0:
        return (0.0, 0.0, 0.0)
    return (float(values.min()), float(values.mean()), float(values.max()))
