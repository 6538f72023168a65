"""Plans as URScript: poses in metres and rotation vectors, movep along rows, movel between them.

Blends of neighbouring poses may not overlap (UR script manual), so the blend
radius stays below half of the shorter step beside each reading.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.plan import SCAN, ScanPlan
from eddyscan.formats.plan_poses import MM_PER_M

ACCELERATION_M_S2 = 0.5
BLEND_OF_STEP = 0.4
PROGRAM = "eddyscan_plan"


def write(plan: ScanPlan, path: Path) -> None:
    """Write a plan as one URScript function; the part frame is the feature the caller sets as `part`."""
    position = plan.T_part_probe[:, :3, 3] / MM_PER_M
    turn = Rotation.from_matrix(plan.T_part_probe[:, :3, :3]).as_rotvec()
    blend = blends_m(plan)
    lines = [f"def {PROGRAM}(part):"]
    for k in range(len(plan)):
        pose = ", ".join(f"{value:.7f}" for value in (*position[k], *turn[k]))
        speed = plan.speed_mm_s[k] / MM_PER_M
        along = plan.kind[k] == SCAN and plan.point[k] > 0
        lines.append(
            f"  {'movep' if along else 'movel'}(pose_trans(part, p[{pose}]), "
            f"a={ACCELERATION_M_S2}, v={speed:.4f}, r={blend[k]:.6f})"
        )
    path.write_text("\n".join([*lines, "end", ""]), encoding="ascii")


def blends_m(plan: ScanPlan) -> Array:
    """Return each pose's blend radius (N,) [m]; 0 except inside rows."""
    step = np.linalg.norm(np.diff(plan.T_part_probe[:, :3, 3], axis=0), axis=1)
    scan = plan.kind == SCAN
    inside = np.zeros(len(plan), dtype=bool)
    inside[1:-1] = scan[1:-1] & scan[:-2] & scan[2:] & (plan.row[2:] == plan.row[:-2])
    shorter = np.minimum(np.append(step, 0.0), np.append(0.0, step))
    return np.asarray(np.where(inside, BLEND_OF_STEP * shorter / MM_PER_M, 0.0))


def read_poses(path: Path) -> tuple[Array, Array]:
    """Read back what `write` wrote: T_part_probe (N, 4, 4) [mm] and blend radii (N,) [m].

    Raises
    ------
    FileError
        When no move is found.
    """
    text = path.read_text(encoding="ascii")
    found = re.findall(r"p\[([^\]]+)\]\).*?r=([\d.]+)\)", text)
    if not found:
        raise FileError(f"{path} holds no movel or movep. Export it again.")
    values = np.array([[float(v) for v in pose.split(",")] for pose, _ in found])
    T = np.tile(np.eye(4), (len(values), 1, 1))
    T[:, :3, :3] = Rotation.from_rotvec(values[:, 3:]).as_matrix()
    T[:, :3, 3] = values[:, :3] * MM_PER_M
    return T, np.array([float(radius) for _, radius in found])
