"""Where the probe must not go: below the surface, and into what stands around the part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import Array, IntArray, apply
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import KINDS, ScanPlan
from eddyscan.core.technique import Probe

SAMPLE_MM = 1.0
NARROW = 1e-3  # width over length below which spots lie on one line
UPWARD = 0.2  # least z of a normal that belongs to the inspected side
MOST_CORRECTED_MM = 1.5  # how far a plan's surface may lie from the mesh it was made on
TOUCH_MM = 0.05  # a chord may come this much nearer than zero: the mesh's own roughness


@dataclass(frozen=True)
class KeepOut:
    """A box that the probe may not enter, for example a clamp [mm, stage]."""

    name: str
    lower_mm: tuple[float, float, float]
    upper_mm: tuple[float, float, float]


def refuse_keep_out(
    plan: ScanPlan,
    targets: Array,
    T_stage_part: Array,
    *,
    probe: Probe,
    boxes: Sequence[KeepOut] = (),
    mesh: SurfaceMesh | None = None,
) -> None:
    """Refuse a plan whose straight ways between poses enter the part or a box.

    Parameters
    ----------
    targets : (N, 3) axis readings of the plan's poses [mm, stage]
    probe : its body is taken as an upright cylinder above the coil face
    boxes : clamps, stops and the like [mm, stage]
    mesh : the surface [part]; without it the plan's coil faces less their lift-off stand for it

    Raises
    ------
    TravelError
        Naming the pose, the depth and the box or the spot.
    """
    way, owner = _along_the_way(targets)
    height = _surface_height(plan, T_stage_part, mesh)
    depth = height(way[:, :2]) - way[:, 2]
    if np.nanmax(depth, initial=-np.inf) > TOUCH_MM:
        worst = int(np.nanargmax(depth))
        index = int(owner[worst])
        raise TravelError(
            f"on its way to {KINDS[plan.kind[index]]} pose {index} (row {plan.row[index]}) the coil would go "
            f"{depth[worst]:.2f} mm into the part at x = {way[worst, 0]:.1f}, y = {way[worst, 1]:.1f} mm (limit "
            f"{TOUCH_MM:g}). Raise scan.clearance_mm, or make the plan again with a smaller step_mm."
        )
    for box in boxes:
        _refuse_box(plan, way, owner, box, probe)


def _refuse_box(plan: ScanPlan, way: Array, owner: IntArray, box: KeepOut, probe: Probe) -> None:
    lower, upper = np.array(box.lower_mm), np.array(box.upper_mm)
    outside = np.maximum(lower[:2] - way[:, :2], way[:, :2] - upper[:2]).max(axis=1)
    beside = outside - max(probe.body_radius_mm, probe.tip_radius_mm)
    above = way[:, 2] - upper[2]
    below = lower[2] - (way[:, 2] + probe.body_length_mm)
    distance = np.maximum(np.maximum(above, below), beside)
    worst = int(distance.argmin())
    if distance[worst] < 0:
        index = int(owner[worst])
        raise TravelError(
            f"on its way to {KINDS[plan.kind[index]]} pose {index} (row {plan.row[index]}) the probe's body would "
            f"enter the keep-out zone {box.name!r} by {-distance[worst]:.2f} mm (limit 0) at x = {way[worst, 0]:.1f}, "
            f"y = {way[worst, 1]:.1f}, z = {way[worst, 2]:.1f} mm. Move the {box.name}, or inspect less of the part."
        )


def _along_the_way(targets: Array) -> tuple[Array, IntArray]:
    """Return points (M, 3) at most a sample apart on the straight ways, and the pose each leads to (M,)."""
    steps = np.diff(targets, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(steps, axis=1) / SAMPLE_MM).astype(int), 1)
    owner = np.repeat(np.arange(1, len(targets)), counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(owner)) - first + 1) / counts[owner - 1]
    way = targets[owner - 1] + share[:, None] * steps[owner - 1]
    return np.vstack([targets[:1], way]), np.concatenate([[0], owner])


def _surface_height(plan: ScanPlan, T_stage_part: Array, mesh: SurfaceMesh | None) -> Callable[[Array], Array]:
    """Return a function from places (M, 2) to heights of the surface [mm, stage]; NaN where it is not known."""
    face, normal = plan.T_part_probe[plan.is_scan, :3, 3], plan.normal[plan.is_scan]
    spots = apply(T_stage_part, face - plan.lift_off_mm[plan.is_scan, None] * normal)
    expected = _interpolated(spots)
    if mesh is None:
        return expected
    shape = _interpolated(apply(T_stage_part, mesh.vertices[mesh.normals[:, 2] > UPWARD]))
    off = spots[:, 2] - shape(spots[:, :2])
    off = np.where(np.isfinite(off), off, 0.0) * normal[:, 2]  # along the normal: heights on a wall say little
    worst = int(np.abs(off).argmax())
    if abs(off[worst]) > MOST_CORRECTED_MM:
        raise TravelError(
            f"the plan expects the surface {off[worst]:+.2f} mm from where the mesh has it (limit "
            f"{MOST_CORRECTED_MM:g}) at x = {spots[worst, 0]:.1f}, y = {spots[worst, 1]:.1f} mm. "
            "Align the part again, or make the plan again."
        )
    moved = _interpolated(np.column_stack([spots[:, :2], off]))  # a corrected plan knows better where the mesh lies
    return lambda places: shape(places) + np.nan_to_num(moved(places))


def _interpolated(spots: Array) -> Callable[[Array], Array]:
    """Return heights between spots (N, 3) as a function of places (M, 2); NaN beyond them."""
    centre = spots[:, :2].mean(axis=0)
    _, extent, directions = np.linalg.svd(spots[:, :2] - centre, full_matrices=False)
    if len(spots) > 2 and extent[1] > NARROW * extent[0]:
        linear = LinearNDInterpolator(spots[:, :2], spots[:, 2])
        return lambda places: np.asarray(linear(places), dtype=np.float64)
    along = (spots[:, :2] - centre) @ directions[0]  # a single row spans no area
    order = np.argsort(along)

    def on_the_row(places: Array) -> Array:
        offset = places - centre
        beside = np.abs(offset @ np.array([-directions[0][1], directions[0][0]]))
        height = np.interp(offset @ directions[0], along[order], spots[order, 2], left=np.nan, right=np.nan)
        return np.where(beside <= SAMPLE_MM, height, np.nan)

    return on_the_row
