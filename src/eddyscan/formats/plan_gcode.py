"""Plans as G-code for GRBL and its like: x, y, z of the coil face in mm, rotary axes with inverse-time feed.

A machine with rotary axes gets A (turn about x) and B (turn about y) of the
probe, which is vertical at A = B = 0, and G93: there F is 1 / minutes for the
block, because a feed in mm/min has no meaning once rotary axes turn
(LinuxCNC manual, G93). Readings are marked by a comment and a dwell (G4).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.plan import KINDS, SCAN, ScanPlan

DECIMALS = 4
LEAST_MINUTES = 1e-5


def write(plan: ScanPlan, path: Path) -> None:
    """Write a plan as G-code."""
    angles = rotary_deg(plan.T_part_probe[:, :3, 2])
    rotary = bool(np.abs(angles).max() > 1e-6)
    settle_s = float(plan.settings.get("scan", {}).get("settle_s", 0.0))
    lines = ["(eddyscan plan; mm; coil face; part frame)", "G21", "G90", "G93" if rotary else "G94"]
    row = -1
    for k in range(len(plan)):
        if plan.row[k] != row:
            row = int(plan.row[k])
            lines.append(f"(row {row})")
        words = [f"{axis}{value:.{DECIMALS}f}" for axis, value in zip("XYZ", plan.T_part_probe[k, :3, 3], strict=True)]
        if rotary:
            words += [f"{axis}{value:.{DECIMALS}f}" for axis, value in zip("AB", angles[k], strict=True)]
        lines.append(f"G1 {' '.join(words)} F{_feed(plan, k, rotary=rotary)} ({KINDS[plan.kind[k]]} {plan.point[k]})")
        if plan.kind[k] == SCAN and settle_s > 0:
            lines.append(f"G4 P{settle_s:.3f}")
    lines += ["G94", "M2"] if rotary else ["M2"]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def rotary_deg(axis: Array) -> Array:
    """Return A and B (N, 2) [deg] that turn a probe from straight down to `axis` (N, 3): B, then A."""
    b = np.arcsin(np.clip(-axis[:, 0], -1, 1))
    a = np.arctan2(axis[:, 1], -axis[:, 2])
    return np.asarray(np.degrees(np.stack([a, b], axis=1)))


def axis_of(angles_deg: Array) -> Array:
    """Return the probe axis (N, 3) that A and B (N, 2) [deg] make: the inverse of `rotary_deg`."""
    a, b = np.radians(angles_deg).T
    return np.stack([-np.sin(b), np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b)], axis=1)


def _feed(plan: ScanPlan, k: int, *, rotary: bool) -> str:
    if not rotary:
        return f"{60 * plan.speed_mm_s[k]:.1f}"
    length = 0.0 if k == 0 else float(np.linalg.norm(plan.T_part_probe[k, :3, 3] - plan.T_part_probe[k - 1, :3, 3]))
    return f"{1 / max(length / plan.speed_mm_s[k] / 60, LEAST_MINUTES):.4f}"


def read_positions(path: Path) -> tuple[Array, Array, list[str]]:
    """Read back what `write` wrote: positions (N, 3) [mm], A and B (N, 2) [deg], kinds.

    Raises
    ------
    FileError
        When a motion line cannot be read.
    """
    positions, angles, kinds = [], [], []
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), start=1):
        if not line.startswith("G1 "):
            continue
        words = dict(re.findall(r"([XYZABF])(-?[\d.]+)", line.split("(")[0]))
        if not {"X", "Y", "Z", "F"} <= set(words):
            raise FileError(f"{path}, line {number}: a motion needs X, Y, Z and F, found {line!r}. Export it again.")
        positions.append([float(words[axis]) for axis in "XYZ"])
        angles.append([float(words.get(axis, 0.0)) for axis in "AB"])
        kinds.append(line.split("(")[1].split()[0])
    return np.array(positions), np.array(angles), kinds
