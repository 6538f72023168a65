"""Plans as KUKA KRL: positions in mm, A B C as Z-Y-X Euler angles in degrees, SLIN within a spline per row."""

from __future__ import annotations

import re
from itertools import groupby
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.plan import SCAN, ScanPlan
from eddyscan.formats.plan_poses import MM_PER_M


def write(plan: ScanPlan, path: Path) -> None:
    """Write a plan as a .src program; base and tool are the caller's ($BASE is the part frame, $TOOL the coil face)."""
    position = plan.T_part_probe[:, :3, 3]
    # Near B = 90 deg A and C share one turn; C = 0 there is as good as any.
    angles = _quiet_euler(plan.T_part_probe[:, :3, :3])
    poses = [_pose(position[k], angles[k]) for k in range(len(plan))]
    lines = ["&ACCESS RVP", f"DEF {_name(path)}( )", "; eddyscan plan; mm and deg; BASE = part, TOOL = coil face"]
    keys = [(int(plan.row[k]), bool(plan.kind[k] == SCAN)) for k in range(len(plan))]
    for (row, scan), group in groupby(range(len(plan)), key=keys.__getitem__):
        numbers = list(group)
        if scan:
            lines += [f"; row {row}", f"$VEL.CP={plan.speed_mm_s[numbers[-1]] / MM_PER_M:.4f}", "SPLINE"]
            lines += [f"  SLIN {poses[k]}" for k in numbers]
            lines.append("ENDSPLINE")
        else:
            for k in numbers:
                lines += [f"$VEL.CP={plan.speed_mm_s[k] / MM_PER_M:.4f}", f"LIN {poses[k]}"]
    path.write_text("\n".join([*lines, "END", ""]), encoding="ascii")


def _name(path: Path) -> str:
    """Return the program's name: KRL allows 24 letters, digits and underscores, not a digit first."""
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)[:24]
    return name if name[:1].isalpha() else f"P_{name}"[:24]


def _quiet_euler(rotation: Array) -> Array:
    b = np.arcsin(np.clip(-rotation[:, 2, 0], -1, 1))
    locked = np.abs(np.cos(b)) < 1e-6
    a = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    c = np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2])
    a = np.where(locked, np.arctan2(-rotation[:, 0, 1], rotation[:, 1, 1]), a)
    return np.asarray(np.degrees(np.stack([a, b, np.where(locked, 0.0, c)], axis=1)))


def _pose(position: Array, angles: Array) -> str:
    names = ("X", "Y", "Z", "A", "B", "C")
    values = (*position, *angles)
    return "{" + ", ".join(f"{name} {value:.5f}" for name, value in zip(names, values, strict=True)) + "}"


def read_poses(path: Path) -> Array:
    """Read back what `write` wrote: T_part_probe (N, 4, 4) [mm].

    Raises
    ------
    FileError
        When no pose is found.
    """
    found = re.findall(r"LIN \{([^}]+)\}", path.read_text(encoding="ascii"))
    if not found:
        raise FileError(f"{path} holds no LIN or SLIN. Export it again.")
    values = np.array([[float(word.split()[1]) for word in pose.split(",")] for pose in found])
    T = np.tile(np.eye(4), (len(values), 1, 1))
    T[:, :3, :3] = Rotation.from_euler("ZYX", values[:, 3:], degrees=True).as_matrix()
    T[:, :3, 3] = values[:, :3]
    return T
