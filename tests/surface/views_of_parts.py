"""Virtual views for the tests, taken once per session."""

from __future__ import annotations

from functools import cache

import numpy as np

from eddyscan.devices.sim.camera import VirtualDepthCamera
from eddyscan.devices.sim.world_scene import build_scene
from eddyscan.devices.sim.world_settings import WorldCamera


@cache
def part_views(name: str, seed: int = 3, clutter: int = 4):
    """Return five views and the true T_part_camera of each."""
    scene = build_scene(name, seed=seed, clutter=clutter, edge_mm=2.0)
    camera = VirtualDepthCamera(scene, WorldCamera(), seed)
    poses = [np.linalg.inv(scene.T_table_part) @ T for T in camera.true_poses()]
    return tuple(camera.capture_views(5)), tuple(poses)
