"""The depth camera of the virtual cell: ray casting seen through a stereo sensor."""

from __future__ import annotations

import numpy as np

from eddyscan.core.depth import DepthImage
from eddyscan.core.fiducials import FiducialSheet
from eddyscan.core.frames import Array
from eddyscan.core.progress import Progress, silent
from eddyscan.devices.protocols import Identity
from eddyscan.devices.sim.camera_infrared import InfraredView
from eddyscan.devices.sim.camera_raycast import Raycaster
from eddyscan.devices.sim.sensor import StereoSensor
from eddyscan.devices.sim.world_scene import OS30A, PART_SOLID, Scene, camera_poses
from eddyscan.devices.sim.world_settings import WorldCamera


class VirtualDepthCamera:
    """A depth camera that a person holds over the table, one pose per view.

    It keeps its poses to itself: images carry none, as with a hand-held camera.
    """

    def __init__(self, scene: Scene, options: WorldCamera, seed: int) -> None:
        self._scene, self._options, self._seed = scene, options, seed
        self._raycaster: Raycaster | None = None
        self._sensor: StereoSensor | None = None
        self._infrared = InfraredView(scene, FiducialSheet(), seed) if options.fiducials else None
        self._taken = 0
        self._poses = self._draw_poses(options.views, seed)

    def identity(self) -> Identity:
        """Say what the camera is: a simulation of the study's."""
        return Identity("camera", "simulated YDLIDAR OS30A", f"virtual-{self._seed}", verified=True)

    def capture(self) -> DepthImage:
        """Take the next view of the camera's round; after the last comes the first again."""
        k = self._taken
        self._taken += 1
        return self._view(self._poses[k % len(self._poses)], f"view-{k}", (self._seed, k))

    def capture_views(self, n: int = 5, seed: int | None = None, progress: Progress = silent) -> list[DepthImage]:
        """Take `n` views from poses drawn from `seed` (the cell's own when None)."""
        chosen = self._seed if seed is None else seed
        views = []
        for k, pose in enumerate(self._draw_poses(n, chosen)):
            progress("capture views", k, n)
            views.append(self._view(pose, f"view-{k}", (chosen, k)))
        progress("capture views", n, n)
        return views

    def close(self) -> None:
        """Free the ray-casting scene."""
        self._raycaster = None

    def true_poses(self, n: int | None = None, seed: int | None = None) -> list[Array]:
        """Return T_table_camera of the views: truth, for benchmarks and tests alone."""
        return self._draw_poses(n or self._options.views, self._seed if seed is None else seed)

    def _draw_poses(self, n: int, seed: int) -> list[Array]:
        return camera_poses(self._scene, self._options, n, np.random.default_rng([seed, 2]))

    def _view(self, pose: Array, name: str, noise_seed: tuple[int, int]) -> DepthImage:
        if self._raycaster is None:
            self._raycaster = Raycaster(list(self._scene.meshes))
        if self._sensor is None:
            self._sensor = StereoSensor.made(self._options, OS30A.fx, (OS30A.height, OS30A.width), self._seed)
        hits = self._raycaster.cast(OS30A, pose)
        rng = np.random.default_rng([*noise_seed, 3])
        depth = self._sensor.depth(hits, hits.solid == PART_SOLID, rng)
        picture = None if self._infrared is None else self._infrared.picture(hits, OS30A, pose, rng)
        return DepthImage(depth.astype(np.float64), OS30A, name, intensity=picture)
