"""Alignment by touch of the field: the coil finds the part, without contact, target or drawing.

From the operator's rough corner the probe comes down over a handful of chosen
spots until the coil reads about a millimetre of lift-off, and runs out over a few
spots of the rim. One least-squares solution then gives the part's pose on the
stage, the camera's scale error, and how well each is known.
"""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass

import numpy as np

from eddyscan.core.footing import Footing
from eddyscan.core.frames import Array, apply, checked_transform, invert, rotate
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Clock, EddyInstrument, Stage
from eddyscan.physics import Coil, Conductor, impedance_change_ohm
from eddyscan.physics.coil_calibration import calibrate_coil
from eddyscan.physics.sound_response import (
    SoundResponse,
    coil_by_air_reading,
    sound_response,
    technique_coil,
    technique_conductor,
)
from eddyscan.scanning.field_motion import NOISE_SHARE, READS, TARGET_MM, FieldProbe, approach, climb, cross_rim
from eddyscan.scanning.field_pose import Evidence, Pose, PoseSolver

AIR_READS = 8
CALIBRATE_AFTER = 3
FLAT_DEG = 4.0
CLIMB_MM = (0.0, 0.15, 0.15, 0.15, 0.2, 0.2, 0.3, 0.4, 0.5, 0.7)
ROUGH_Z_MM = 9.0
KNOWN_Z_MM = 1.2
INSIDE_RIM_MM = 14.0
CORNER_MM = 10.0
BEYOND_RIM_MM = 1.6
CANDIDATES = 400
LARGEST_TILT_DEG = 22.0
FARTHEST_MM = 6.0
NO_METAL_MM = 30.0  # the coil feels nothing of metal this far away
WEAK_MM = 0.5
WEAK_DEG = 0.5
IN_PLANE = [2, 3, 4, 6]


@dataclass(frozen=True)
class Alignment:
    """Where the part is on the stage, and how well that is known.

    Attributes
    ----------
    T_stage_part : (4, 4)
    scale : float
        True size over the mesh's size; multiply the mesh by it (see `scaled`).
    air_ohm : complex [ohm]
        Reading in air, for the record's meta under `air`.
    residual_mm : float [mm] rms of measured minus modelled lift-off
    z_sigma_mm, tilt_sigma_deg, in_plane_sigma_mm : standard uncertainties, the last the larger of x and y
    contacts, crossings : int
    duration_s : float [s] of the stage's clock
    coil : Coil
        As fitted to this approach; for the record's meta under `coil` (see `as_dict`).
    conductivity_ms_m : float
    weak_directions : tuple of str
    """

    T_stage_part: Array
    scale: float
    air_ohm: complex
    residual_mm: float
    z_sigma_mm: float
    tilt_sigma_deg: float
    in_plane_sigma_mm: float
    contacts: int
    crossings: int
    duration_s: float
    coil: Coil
    conductivity_ms_m: float
    weak_directions: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, object]:
        """Return plain values for the record's meta and the report."""
        values = {key: value for key, value in vars(self).items() if key not in ("T_stage_part", "air_ohm", "coil")}
        values["weak_directions"] = list(self.weak_directions)
        return (
            values
            | {"T_stage_part": self.T_stage_part.tolist(), "air": [self.air_ohm.real, self.air_ohm.imag]}
            | {"coil": {**asdict(self.coil), "conductivity_ms_m": self.conductivity_ms_m}}
        )


def align(
    mesh: SurfaceMesh,
    technique: Technique,
    *,
    stage: Stage,
    instrument: EddyInstrument,
    clock: Clock,
    T_stage_part: Array,
    contacts: int = 8,
    crossings: int = 5,
    progress: Progress = silent,
) -> Alignment:
    """Find the part's pose on the stage with the coil.

    Parameters
    ----------
    mesh : SurfaceMesh [mm, part]
    technique : Technique
    stage, instrument, clock : the rig
    T_stage_part : (4, 4)
        The operator's rough corner, good to a few mm and deg.
    contacts, crossings : int
        Spots of the surface and of the rim to visit; crossings that the travel
        does not allow are left out.

    Raises
    ------
    GeometryError
        When there is no metal where the rough corner says.
    TechniqueError
        When the coil's air reading does not belong to the technique's coil.
    DeviceError
        From the devices; the probe is stopped and lifted first.
    """
    rough = checked_transform(T_stage_part, "the rough alignment")
    probe = FieldProbe(stage, instrument, clock, technique)
    if not stage.is_homed():
        stage.home()
    instrument.configure(technique.drive)
    began = clock.now()
    try:
        return _align(mesh, probe, rough, contacts, crossings, began, progress)
    except BaseException:
        with contextlib.suppress(Exception):
            stage.stop()
        with contextlib.suppress(Exception):
            probe.lift()
        raise


def read_air(probe: FieldProbe) -> complex:
    """Lift the probe to the end of its travel and return the mean of eight readings [ohm]."""
    probe.lift()
    return probe.read(AIR_READS)


def scaled(mesh: SurfaceMesh, scale: float) -> SurfaceMesh:
    """Return the mesh with its size corrected by an alignment's scale."""
    return SurfaceMesh(mesh.vertices * scale, mesh.faces, mesh.normals, mesh.uncertainty_mm, mesh.frame)


def _align(
    mesh: SurfaceMesh,
    probe: FieldProbe,
    rough: Array,
    contacts: int,
    crossings: int,
    began_s: float,
    progress: Progress,
) -> Alignment:
    total = contacts + crossings
    air = read_air(probe)
    high = probe.stage.position()[:3].copy()
    solver = PoseSolver(mesh, _response(probe.technique, air), rough)
    evidence, pose = Evidence(), solver.solve(Evidence())
    for spot in _spread_spots(mesh, solver, contacts):
        progress("aligning", len(evidence.over_ohm), total)
        evidence = _visit(probe, solver, pose, evidence, spot)
        pose = solver.solve(evidence, pose)
        if len(evidence.over_ohm) == CALIBRATE_AFTER:
            solver.response = _calibrated(probe, solver, pose, mesh)
            pose = solver.solve(evidence, pose)
    probe.lift()
    for number, rim_point in enumerate(_rim_spots(solver, probe, pose, crossings)):
        progress("aligning", contacts + number, total)
        found = _cross(probe, solver, pose, rim_point)
        evidence = evidence if found is None else evidence.with_crossing(found, solver.rim.inward[rim_point])
        pose = solver.solve(evidence, pose)
    probe.lift()
    solver.response, air = _without_metal(solver, pose, air, high)
    pose = solver.solve(evidence, pose)
    progress("aligning", total, total)
    return _told(solver.response, pose, evidence, air, probe.clock.now() - began_s)


def _response(technique: Technique, air_ohm: complex) -> SoundResponse:
    frequency = technique.drive.frequency_hz
    coil = coil_by_air_reading(technique_coil(technique), air_ohm, frequency)
    return sound_response(
        coil,
        technique_conductor(technique),
        frequency,
        air_ohm=air_ohm,
        largest_lift_off_mm=FARTHEST_MM,
        largest_tilt_deg=LARGEST_TILT_DEG,
    )


def _calibrated(probe: FieldProbe, solver: PoseSolver, pose: Pose, mesh: SurfaceMesh) -> SoundResponse:
    """Return the curve of the coil as it is, from heights over the flattest spot; unchanged on a part without one."""
    inside = np.flatnonzero(solver.rim.distance_mm(mesh.vertices) > INSIDE_RIM_MM)
    axis = rotate(invert(pose.T_stage_part), np.array([[0.0, 0.0, -1.0]]))[0]
    if len(inside) == 0:
        return solver.response
    here = apply(invert(pose.T_stage_part), probe.stage.position()[None, :3])[0]
    steep = np.degrees(np.arccos(np.clip(-(mesh.normals[inside] @ axis), -1, 1)))
    near = np.linalg.norm(mesh.vertices[inside] - here, axis=1)
    spot = mesh.vertices[inside[int(np.argmin(steep + near / 50.0))]]
    below = solver.surface.below(spot[None], axis=axis)
    if below.tilt_deg[0] > FLAT_DEG:
        return solver.response
    over = apply(pose.T_stage_part, below.foot_mm)[0]
    lowest = float(over[2]) - ROUGH_Z_MM
    start = float(over[2]) + KNOWN_Z_MM + TARGET_MM
    bottom, _ = approach(probe, solver.response, over, start_mm=start, lowest_mm=lowest, tilt_deg=0.0)
    heights, heard = climb(probe, bottom, np.cumsum(CLIMB_MM))
    old, frequency = solver.response, solver.response.frequency_hz
    fitted = calibrate_coil(
        technique_coil(probe.technique),
        old.conductor.layers[0].conductivity_ms_m,
        frequency,
        height_mm=heights * np.cos(np.radians(below.tilt_deg[0])),
        impedance_ohm=heard,
        air_ohm=old.air_ohm,
        noise_ohm=NOISE_SHARE * abs(old.air_ohm.imag) / np.sqrt(2 * READS),
    )
    return sound_response(
        fitted.coil,
        Conductor.half_space(fitted.conductivity_ms_m),
        frequency,
        air_ohm=old.air_ohm,
        largest_lift_off_mm=FARTHEST_MM,
        largest_tilt_deg=LARGEST_TILT_DEG,
    )


def _spread_spots(mesh: SurfaceMesh, solver: PoseSolver, count: int) -> list[Array]:
    """Choose surface spots (3,) [part] that pin the pose best, greedily by the information they add.

    The first three wait inside: there the rough corner's error matters least.
    """
    inside = solver.rim.distance_mm(mesh.vertices) > INSIDE_RIM_MM
    flat = mesh.normals[:, 2] > np.cos(np.radians(LARGEST_TILT_DEG - 2.0))
    pool = np.flatnonzero(inside & flat)
    pool = np.flatnonzero(flat) if len(pool) < count else pool
    pool = pool[:: max(1, len(pool) // CANDIDATES)]
    below: Footing = solver.surface.below(mesh.vertices[pool])
    rows = solver.contact_row(below.foot_mm, below.normal) / solver.contact_sigma_mm
    chosen = below.foot_mm[_most_telling(rows, _prior_information(), count)]
    return [*chosen[:3], *_in_short_order(chosen[3:], chosen[min(2, len(chosen) - 1)])]


def _in_short_order(spots: Array, start: Array) -> list[Array]:
    """Return spots so that each is followed by the nearest one left."""
    left, order, here = list(spots), [], start
    while left:
        nearest = int(np.argmin([np.linalg.norm(spot - here) for spot in left]))
        here = left.pop(nearest)
        order.append(here)
    return order


def _prior_information() -> Array:
    return np.diag([1e3] * 3 + [1e-1] * 3 + [1.0, 1e5])


def _most_telling(rows: Array, information: Array, count: int) -> list[int]:
    """Return row numbers that raise the determinant of the information most, one after the other."""
    chosen: list[int] = []
    for _ in range(min(count, len(rows))):
        gain = (rows @ np.linalg.inv(information) * rows).sum(axis=1)
        gain[chosen] = -1.0
        best = int(np.argmax(gain))
        chosen.append(best)
        information = information + np.outer(rows[best], rows[best])
    return chosen


def _visit(probe: FieldProbe, solver: PoseSolver, pose: Pose, evidence: Evidence, spot: Array) -> Evidence:
    over = apply(pose.T_stage_part, spot[None])[0]
    T_part_stage = invert(pose.T_stage_part)
    axis = rotate(T_part_stage, np.array([[0.0, 0.0, -1.0]]))[0]
    tilt = float(solver.surface.below(spot[None], axis=axis).tilt_deg[0])
    known = len(evidence.over_ohm) >= 3
    margin = KNOWN_Z_MM + TARGET_MM if known else ROUGH_Z_MM
    place, heard = approach(
        probe,
        solver.response,
        over,
        start_mm=float(over[2]) + margin,
        lowest_mm=max(float(over[2]) - ROUGH_Z_MM, probe.lower[2]),
        tilt_deg=tilt,
    )
    return evidence.with_contact(place, heard)


def _rim_spots(solver: PoseSolver, probe: FieldProbe, pose: Pose, count: int) -> list[int]:
    """Choose rim points whose crossings pin the in-plane pose, away from corners and inside the travel."""
    rim = solver.rim
    # A stride through the rim's points can miss a whole side: they are ordered by the mesh's numbering.
    pool = np.random.default_rng(0).permutation(len(rim.points_mm))[: 2 * CANDIDATES]
    outside = apply(pose.T_stage_part, rim.points_mm[pool] - BEYOND_RIM_MM * rim.inward[pool])
    straight = np.array([_straight(solver, int(k)) for k in pool])
    upright = rim.normal[pool, 2] > np.cos(np.radians(LARGEST_TILT_DEG - 2.0))
    pool = pool[straight & upright & np.all((outside >= probe.lower) & (outside <= probe.upper), axis=1)]
    # Yaw, x, y and the offset alone: with all eight, what contacts pinned to a micrometre drowns in rounding.
    rows = (solver.crossing_row(rim.points_mm[pool], rim.inward[pool]) / 0.1)[:, IN_PLANE]
    known = np.linalg.inv(pose.covariance[np.ix_(IN_PLANE, IN_PLANE)])
    return [int(pool[k]) for k in _most_telling(rows, np.asarray(known), count)]


def _straight(solver: PoseSolver, number: int) -> bool:
    """Return whether the rim runs straight for 10 mm to either side of a rim point."""
    near = np.linalg.norm(solver.rim.points_mm - solver.rim.points_mm[number], axis=1) < CORNER_MM
    return bool((solver.rim.inward[near] @ solver.rim.inward[number]).min() > 0.9)


def _cross(probe: FieldProbe, solver: PoseSolver, pose: Pose, rim_point: int) -> Array | None:
    rim = solver.rim
    sigma = float(np.sqrt(max(pose.covariance[3, 3], pose.covariance[4, 4])))
    inside = 3.5 + min(2.0 * sigma, 8.0)

    def path(inside_mm: float) -> Array:
        spot = rim.points_mm[rim_point] + rim.inward[rim_point] * inside_mm
        held = rim.points_mm[rim_point] + rim.inward[rim_point] * max(inside_mm, 1.0)
        below = solver.surface.below(held[None])
        foot = spot + below.normal[0] * float(((below.foot_mm[0] - spot) * below.normal[0]).sum())
        tilt = np.degrees(np.arccos(np.clip(below.normal[:, 2], -1, 1)))
        face = foot + below.normal[0] * (TARGET_MM + float(solver.response.rim_mm(tilt)[0]))
        return np.asarray(apply(pose.T_stage_part, face[None])[0])

    found = cross_rim(probe, solver.response.air_ohm, path, inside_mm=inside, outside_mm=inside + 4.0)
    probe.rise_and_cross(probe.stage.position()[:3], float(probe.stage.position()[2]) + KNOWN_Z_MM)
    return found


def _without_metal(solver: PoseSolver, pose: Pose, air_ohm: complex, high_mm: Array) -> tuple[SoundResponse, complex]:
    """Return curve and air reading after taking out what the metal far below still did to the air reading."""
    at = apply(invert(pose.T_stage_part), high_mm[None])
    old = solver.response
    if solver.surface.nearest_mm(at) > NO_METAL_MM:
        return old, air_ohm
    distance = float(solver.surface.below(at).distance_mm[0])
    change = complex(impedance_change_ohm(old.coil, old.conductor, old.frequency_hz, np.array([max(distance, 1.0)]))[0])
    air = air_ohm - change * old.gain
    return (
        sound_response(
            old.coil,
            old.conductor,
            old.frequency_hz,
            air_ohm=air,
            largest_lift_off_mm=old.largest_clearance_mm,
            largest_tilt_deg=old.largest_tilt_deg,
        ),
        air,
    )


def _told(response: SoundResponse, pose: Pose, evidence: Evidence, air_ohm: complex, duration_s: float) -> Alignment:
    sigma = np.sqrt(np.diag(pose.covariance))
    R = pose.T_stage_part[:3, :3]
    shift = np.sqrt(np.diag(R @ pose.covariance[3:6, 3:6] @ R.T))
    weak = [f"slides along {axis} by +-{2 * s:.1f} mm" for axis, s in zip("xy", shift, strict=False) if s > WEAK_MM]
    turns = zip("xyz", np.degrees(sigma[:3]), strict=True)
    weak += [f"turns about {axis} by +-{2 * s:.1f} deg" for axis, s in turns if s > WEAK_DEG]
    return Alignment(
        pose.T_stage_part,
        pose.scale,
        air_ohm,
        float(np.sqrt(np.mean(pose.residual_mm**2))),
        float(shift[2]),
        float(np.degrees(max(sigma[0], sigma[1]))),
        float(shift[:2].max()),
        len(evidence.over_ohm),
        len(evidence.edge_stage_mm),
        duration_s,
        response.coil,
        response.conductor.layers[0].conductivity_ms_m,
        tuple(weak),
    )
