"""Poses the way robots write them: out of the surface or into it, metres, quaternions, rotation vectors."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.frames import Array
from eddyscan.core.plan import SCAN, ScanPlan

MM_PER_M = 1000.0
# Probe z points into the part; path planners want it out of the surface, x kept along travel.
OUTWARD = np.diag([1.0, -1.0, -1.0])


def outward_poses(plan: ScanPlan) -> tuple[Array, Array]:
    """Return coil positions (N, 3) [m] and quaternions (N, 4) x y z w, z out of the surface and x along travel."""
    rotation = Rotation.from_matrix(plan.T_part_probe[:, :3, :3] @ OUTWARD)
    return plan.T_part_probe[:, :3, 3] / MM_PER_M, np.asarray(rotation.as_quat(canonical=True))


def row_slices(plan: ScanPlan) -> list[slice]:
    """Return each row's readings as a slice; rows are contiguous."""
    scan = np.flatnonzero(plan.kind == SCAN)
    cuts = np.flatnonzero((np.diff(plan.row[scan]) != 0) | (np.diff(scan) != 1)) + 1
    starts = [0, *cuts.tolist(), len(scan)]
    return [slice(int(scan[a]), int(scan[b - 1]) + 1) for a, b in pairwise(starts)]
