"""Plans as JSON of ROS messages: one geometry_msgs/PoseArray per row, metres, z out of the surface."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.plan import ScanPlan
from eddyscan.formats.plan_poses import outward_poses, row_slices

FRAME = "part"


def write(plan: ScanPlan, path: Path) -> None:
    """Write the rows as noether_ros and snp_msgs have them: segments of poses."""
    position, quaternion = outward_poses(plan)
    segments = [
        {
            "header": {"frame_id": FRAME, "stamp": {"sec": 0, "nanosec": 0}},
            "poses": [_pose(position[k], quaternion[k]) for k in range(row.start, row.stop)],
        }
        for row in row_slices(plan)
    ]
    path.write_text(json.dumps({"type": "geometry_msgs/PoseArray[]", "segments": segments}), encoding="ascii")


def _pose(position: Array, quaternion: Array) -> dict[str, dict[str, float]]:
    return {
        "position": dict(zip("xyz", position.tolist(), strict=True)),
        "orientation": dict(zip("xyzw", quaternion.tolist(), strict=True)),
    }


def read_poses(path: Path) -> list[Array]:
    """Read back what `write` wrote: per row (n, 7) x y z [m], qx qy qz qw.

    Raises
    ------
    FileError
        When the file is no such JSON.
    """
    try:
        segments = json.loads(path.read_text(encoding="ascii"))["segments"]
        return [
            np.array([[p["position"][a] for a in "xyz"] + [p["orientation"][a] for a in "xyzw"] for p in s["poses"]])
            for s in segments
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(f"{path} holds no segments of poses: {error}. Export it again.") from error
