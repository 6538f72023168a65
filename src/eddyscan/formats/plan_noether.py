"""Plans as noether's YAML: tool paths > segments > poses, in metres, z out of the surface, x along travel."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.plan import ScanPlan
from eddyscan.formats.plan_poses import outward_poses, row_slices

KEYS = ("x", "y", "z", "qx", "qy", "qz", "qw")


def write(plan: ScanPlan, path: Path) -> None:
    """Write each row as a tool path of one segment; links and approaches are the receiver's."""
    position, quaternion = outward_poses(plan)
    values = np.concatenate([position, quaternion], axis=1)
    lines = []
    for row in row_slices(plan):
        for k in range(row.start, row.stop):
            lead = "- - - " if k == row.start else "    - "
            words = [f"{key}: {value:.9f}" for key, value in zip(KEYS, values[k], strict=True)]
            lines.append(f"{lead}{{{', '.join(words)}}}")
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def read_poses(path: Path) -> list[Array]:
    """Read back what `write` wrote: per row (n, 7) x y z [m], qx qy qz qw.

    Raises
    ------
    FileError
        When a line is no pose.
    """
    rows: list[list[list[float]]] = []
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), start=1):
        pairs = dict(re.findall(r"(\w+): (-?[\d.]+)", line))
        if set(pairs) != set(KEYS):
            raise FileError(f"{path}, line {number}: not a pose with {', '.join(KEYS)}: {line!r}. Export it again.")
        if line.startswith("- - - "):
            rows.append([])
        rows[-1].append([float(pairs[key]) for key in KEYS])
    return [np.array(row) for row in rows]
