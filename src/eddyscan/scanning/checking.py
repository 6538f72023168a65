"""Everything that can be known before anything moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import Array, checked_transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import KINDS, ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Axis
from eddyscan.scanning.keep_out import KeepOut, refuse_keep_out
from eddyscan.scanning.tilt import TiltHead, axis_targets


def check(
    plan: ScanPlan,
    stage_axes: Sequence[Axis],
    T_stage_part: Array,
    technique: Technique,
    *,
    mesh: SurfaceMesh | None = None,
    keep_out: Sequence[KeepOut] = (),
    head: TiltHead | None = None,
) -> None:
    """Refuse a plan that would leave the stage's travel, enter the part or a keep-out zone; nothing moves.

    Parameters
    ----------
    plan : ScanPlan
    stage_axes : axes x, y, z as the stage reported them [mm]
    T_stage_part : (4, 4) pose of the part on the stage
    technique : Technique
    mesh : the surface [part]; without it the plan's coil faces less their lift-off stand for it
    keep_out : boxes around clamps and stops [mm, stage]
    head : the tilt head, when the stage's fourth axis is one

    Raises
    ------
    TravelError
        When a scan point, link or approach lies outside an axis, or a straight
        way between two of them enters the part or a box; names the worst.
    GeometryError
        When `T_stage_part` is no rigid transform.
    """
    T = checked_transform(T_stage_part, "the part's pose on the stage")
    if len(stage_axes) < 3:
        raise TravelError(f"the stage has {len(stage_axes)} axes; a scan needs x, y and z. Check rig.toml.")
    targets, faces = axis_targets(plan, T, len(stage_axes), head)
    _refuse_beyond_travel(plan, targets, stage_axes)
    _refuse_no_room_to_lift(plan, targets, stage_axes, technique)
    refuse_keep_out(plan, faces, T, probe=technique.probe, boxes=keep_out, mesh=mesh)


def _refuse_no_room_to_lift(plan: ScanPlan, targets: Array, stage_axes: Sequence[Axis], technique: Technique) -> None:
    """The probe crosses over the part between rows and at the end: that needs height above the highest point."""
    highest = float(targets[plan.is_scan, 2].max())
    room, needed = stage_axes[2].upper - highest, min(technique.scan.clearance_mm, 1.0)
    if room < needed:
        raise TravelError(
            f"above the highest scan point (z = {highest:.2f} mm) the stage has {room:.2f} mm of travel left, "
            f"crossing over the part needs {needed:.2f} mm. Mount the part lower or the probe higher."
        )


def _refuse_beyond_travel(plan: ScanPlan, targets: Array, stage_axes: Sequence[Axis]) -> None:
    lower = np.array([axis.lower for axis in stage_axes])
    upper = np.array([axis.upper for axis in stage_axes])
    beyond = np.maximum(lower - targets, targets - upper)
    if beyond.max() <= 1e-9:
        return
    index, k = (int(i) for i in np.unravel_index(int(beyond.argmax()), beyond.shape))
    axis, count = stage_axes[k], int((beyond.max(axis=1) > 1e-9).sum())
    raise TravelError(
        f"{count} of {len(targets)} poses lie outside the stage's travel; the worst is {KINDS[plan.kind[index]]} pose "
        f"{index} (row {plan.row[index]}): {axis.name} = {targets[index, k]:.2f} {axis.unit}, travel "
        f"{axis.lower:.2f} to {axis.upper:.2f} {axis.unit}. Move the part by {beyond.max():.1f} {axis.unit} along "
        f"{axis.name}, or inspect less of it."
    )
