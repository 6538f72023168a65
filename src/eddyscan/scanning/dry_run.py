"""What a scan would move, told before anything does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eddyscan.core.frames import Array, checked_transform
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Axis
from eddyscan.devices.trapezoid import rest_to_rest_s
from eddyscan.scanning.checking import check
from eddyscan.scanning.targets import travel_height_mm
from eddyscan.scanning.tilt import TiltHead, axis_targets

READ_S = 0.03


def what_would_move(
    plan: ScanPlan,
    stage_axes: Sequence[Axis],
    T_stage_part: Array,
    technique: Technique,
    *,
    done: frozenset[tuple[int, int]] = frozenset(),
    head: TiltHead | None = None,
) -> list[str]:
    """Check a scan as `check` does and return in words, line by line, what it would do; nothing moves.

    Parameters
    ----------
    done : (row, point) pairs that already have a reading

    Raises
    ------
    TravelError
        What `check` raises.
    """
    check(plan, stage_axes, T_stage_part, technique, head=head)
    T = checked_transform(T_stage_part, "the part's pose on the stage")
    targets, _ = axis_targets(plan, T, len(stage_axes), head)
    missing = plan.n_scan - sum((int(r), int(p)) in done for r, p in zip(plan.row, plan.point, strict=True))
    lines = [
        f"mode {technique.scan.mode}: {missing} of {plan.n_scan} readings to take in {plan.n_rows} rows",
        f"first up to z = {travel_height_mm(targets, stage_axes, technique):.2f} mm, across, then down at "
        f"{technique.scan.approach_speed_mm_s:g} mm/s",
    ]
    for k, axis in enumerate(stage_axes):
        least, most = float(targets[:, k].min()), float(targets[:, k].max())
        lines.append(
            f"axis {axis.name}: {least:.2f} to {most:.2f} {axis.unit} of {axis.lower:.2f} to {axis.upper:.2f} "
            f"{axis.unit}"
        )
    minutes = expected_s(plan, targets, stage_axes, technique) / 60
    lines.append(f"about {minutes:.1f} min for the whole plan, {float(plan.speed_mm_s.max()):g} mm/s at most")
    return lines


def expected_s(plan: ScanPlan, targets: Array, stage_axes: Sequence[Axis], technique: Technique) -> float:
    """Return about how long the plan takes [s] on these axes in the technique's mode."""
    step = np.abs(np.diff(targets[:, :3], axis=0))
    length = np.linalg.norm(step, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = step / length[:, None]
        top = np.min([axis.max_speed / share[:, k] for k, axis in enumerate(stage_axes[:3])], axis=0)
        strength = np.min([axis.acceleration / share[:, k] for k, axis in enumerate(stage_axes[:3])], axis=0)
    speed = np.minimum(top, plan.speed_mm_s[1:])
    along = plan.is_scan[1:] & plan.is_scan[:-1] & (technique.scan.mode != "step")
    moving = [
        d / v if flowing else rest_to_rest_s(d, v, a)
        for d, v, a, flowing in zip(length, speed, strength, along, strict=True)
        if d > 0
    ]
    stay = plan.n_scan * (technique.scan.settle_s + READ_S) if technique.scan.mode == "step" else 0.0
    return float(sum(moving)) + stay
