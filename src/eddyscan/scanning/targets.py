"""Heights and axis targets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Axis


def travel_height_mm(targets: Array, stage_axes: Sequence[Axis], technique: Technique) -> float:
    """Return the z reading [mm] at which the probe crosses over the part: clear of it, inside the travel."""
    return float(min(targets[:, 2].max() + technique.scan.clearance_mm, stage_axes[2].upper))


def with_z(target: Array, z_mm: float) -> Array:
    """Return a copy of an axis target with another z [mm]."""
    out = np.array(target, dtype=np.float64)
    out[2] = z_mm
    return out
