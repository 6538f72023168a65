"""What the probe says about the surface: a smooth correction of path and mesh, blind to cracks."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial import KDTree

from eddyscan.analysis.gap_field import SurfaceCorrection, gap_field
from eddyscan.analysis.result import AnalysisResult
from eddyscan.core.errors import InputError
from eddyscan.core.footing import footing
from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import SCAN, ScanPlan
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique

LARGEST_SLOPE = 0.05
LARGEST_CORRECTION_MM = 2.0
LEAST_FIT = 6


def surface_correction(
    record: ScanRecord, result: AnalysisResult, mesh: SurfaceMesh, technique: Technique
) -> SurfaceCorrection:
    """Compare the lift-off the probe read with the distance that mesh and positions say.

    Parameters
    ----------
    record : ScanRecord
        The coarse pass (or any scan).
    result : AnalysisResult
        Of `analyse` on that record.
    mesh : SurfaceMesh
        The surface that the plan was made on.
    technique : Technique

    Raises
    ------
    InputError
        When fewer than six readings know their lift-off.
    """
    known = np.isfinite(result.lift_off_mm)
    loud = _near_loud(record.part_mm, np.nan_to_num(_score(result, len(record))), known, technique)
    used = known & ~loud
    if used.sum() < LEAST_FIT:
        raise InputError(
            f"only {int(used.sum())} of {len(record)} readings know their lift-off (at least {LEAST_FIT} are needed to "
            "correct the path). Scan the coarse pass nearer to the surface, or with a smaller pitch."
        )
    below = footing(mesh, record.part_mm[used], axis=None)
    gap = result.lift_off_mm[used] - below.distance_mm
    return gap_field(
        below.foot_mm,
        below.normal,
        gap,
        least_width_mm=technique.probe.outer_radius_mm,
        frozen=int((known & loud).sum()),
    )


def corrected_plan(
    plan: ScanPlan,
    record: ScanRecord,
    result: AnalysisResult,
    technique: Technique,
    *,
    mesh: SurfaceMesh | None = None,
    largest_slope: float = LARGEST_SLOPE,
) -> ScanPlan:
    """Move the plan's poses so that the coil runs at the planned lift-off over the real metal.

    Every pose moves along the probe's own axis by the smooth gap that the coarse
    pass found. The correction follows nothing faster than the smoothing width, is
    limited to `largest_slope` mm per mm of path, and leaves out readings where the
    residual channel is loud, so a crack, which fakes up to 20 um of lift-off, does
    not bend the path.

    Parameters
    ----------
    plan : ScanPlan
        The fine pass as planned on `mesh`.
    record, result : the coarse pass and its analysis
    technique : Technique
    mesh : SurfaceMesh, optional
        Default: the mesh that `result` is mapped on.

    Returns
    -------
    ScanPlan
        Same rows, points and times; `lift_off_mm` of scan poses is unchanged (it is what
        the coil will now really have), a note tells the size of the correction.

    Raises
    ------
    InputError
        When the correction would exceed 2 mm: the part has moved or the alignment is wrong.
    """
    mesh = result.cscan.mesh if mesh is None else mesh
    correction = surface_correction(record, result, mesh, technique)
    scan = plan.kind == SCAN
    face, axis = plan.T_part_probe[:, :3, 3], plan.T_part_probe[:, :3, 2]
    shift = np.zeros(len(plan))
    shift[scan] = _limited(_shifts(mesh, correction, plan, scan), plan, scan, largest_slope)
    shift[~scan] = _of_nearest_scan(shift, face, scan)
    worst = float(np.abs(shift[scan]).max())
    if worst > LARGEST_CORRECTION_MM:
        raise InputError(
            f"the path would move by {worst:.2f} mm (limit {LARGEST_CORRECTION_MM:.0f} mm) to keep its lift-off. "
            "The part moved since the surface was taken, or T_stage_part is wrong: align again."
        )
    T = plan.T_part_probe.copy()
    T[:, :3, 3] = face - axis * shift[:, None]
    note = (
        f"path corrected by the probe's own lift-off: {1e3 * np.sqrt(np.mean(shift[scan] ** 2)):.0f} um rms, "
        f"{1e3 * worst:.0f} um at most, "
        f"from {len(correction.gap_mm)} readings ({correction.frozen} more left out near signals)"
    )
    return dataclasses.replace(plan, T_part_probe=T, notes=(*plan.notes, note))


def corrected_surface(
    mesh: SurfaceMesh, correction: SurfaceCorrection, *, reach_mm: float | None = None
) -> SurfaceMesh:
    """Return the mesh moved to where the probe found the metal, with the uncertainty of that.

    Vertices further than `reach_mm` (default: the smoothing width) from every reading
    fade back to the camera's surface over another two widths and keep its uncertainty.
    """
    gap, sigma = correction.at(mesh.vertices)
    distance, _ = KDTree(correction.foot_mm).query(mesh.vertices)
    reach = correction.width_mm if reach_mm is None else reach_mm
    trust = np.clip(1.0 - (distance - reach) / (2.0 * correction.width_mm), 0.0, 1.0)
    own = np.full(len(gap), np.nan) if mesh.uncertainty_mm is None else mesh.uncertainty_mm
    moved = mesh.vertices - mesh.normals * (trust * gap)[:, None]
    mixed = np.hypot(trust * sigma, (1.0 - trust) * np.nan_to_num(own))
    uncertainty = np.where(trust > 0, mixed, own)
    known = None if np.isnan(uncertainty).any() else uncertainty
    return SurfaceMesh.from_triangles(moved, mesh.faces, known, mesh.frame)


def _score(result: AnalysisResult, n: int) -> Array:
    return np.zeros(n) if result.score is None else result.score


def _near_loud(part_mm: Array, score: Array, known: BoolArray, technique: Technique) -> BoolArray:
    """Return the readings within one coil diameter of a loud residual: the path is frozen there."""
    loud = known & (score >= technique.analysis.threshold_mad)
    if not loud.any():
        return loud
    distance, _ = KDTree(part_mm[loud]).query(part_mm)
    return np.asarray(distance <= 2 * technique.probe.outer_radius_mm)


def _shifts(mesh: SurfaceMesh, correction: SurfaceCorrection, plan: ScanPlan, scan: BoolArray) -> Array:
    """Return how far each scan pose backs off along its axis so that its lift-off becomes the planned one."""
    face, axis = plan.T_part_probe[scan, :3, 3], plan.T_part_probe[scan, :3, 2]
    shift = np.zeros(int(scan.sum()))
    for _ in range(2):
        below = footing(mesh, face - axis * shift[:, None], axis=None)
        gap, _ = correction.at(below.foot_mm)
        wanted = plan.lift_off_mm[scan] - (below.distance_mm + gap)
        shift = shift + wanted / np.maximum(-(axis * below.normal).sum(axis=1), 0.3)
    return shift


def _limited(shift: Array, plan: ScanPlan, scan: BoolArray, largest_slope: float) -> Array:
    """Return the shifts with their change per mm of row limited, from both ends of each row and averaged."""
    out = shift.copy()
    rows, s = plan.row[scan], plan.s_mm[scan]
    for number in np.unique(rows):
        members = np.flatnonzero(rows == number)
        room = largest_slope * np.abs(np.diff(s[members]))
        forward = _held(shift[members], room)
        backward = _held(shift[members][::-1], room[::-1])[::-1]
        out[members] = (forward + backward) / 2
    return out


def _held(values: Array, room: Array) -> Array:
    held = values.copy()
    for k in range(1, len(held)):
        held[k] = held[k - 1] + np.clip(values[k] - held[k - 1], -room[k - 1], room[k - 1])
    return held


def _of_nearest_scan(shift: Array, face: Array, scan: BoolArray) -> Array:
    """Return the shift of the nearest scan pose for links and approaches, so that they stay clear."""
    _, nearest = KDTree(face[scan]).query(face[~scan])
    return np.asarray(shift[scan][nearest])
