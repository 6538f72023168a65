"""From poses on the part to axis readings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eddyscan.core.frames import Array, apply
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Axis


def stage_targets(plan: ScanPlan, T_stage_part: Array) -> Array:
    """Return the coil face's axis readings (N, 3) [mm, stage] for every pose of the plan."""
    return apply(T_stage_part, plan.T_part_probe[:, :3, 3])


def travel_height_mm(targets: Array, stage_axes: Sequence[Axis], technique: Technique) -> float:
    """Return the z reading [mm] at which the probe crosses over the part: clear of it, inside the travel."""
    return float(min(targets[:, 2].max() + technique.scan.clearance_mm, stage_axes[2].upper))


def with_z(target: Array, z_mm: float) -> Array:
    """Return a copy of an axis target with another z [mm]."""
    out = np.array(target, dtype=np.float64)
    out[2] = z_mm
    return out
