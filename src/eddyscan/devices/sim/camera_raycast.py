"""Ray casting of triangle meshes: the adapter around Open3D's RaycastingScene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import Array, invert
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.open3d_loader import load_open3d


@dataclass(frozen=True)
class Hits:
    """What each pixel's ray meets first.

    Attributes
    ----------
    depth_mm : (H, W) float32 [mm]
        Along the optical axis; infinite where the ray leaves the scene.
    facing : (H, W) float32
        Cosine of the angle between the ray and the surface normal, 0..1.
    solid : (H, W) uint32
        Number of the mesh, in the order it was given; a large number where there is none.
    """

    depth_mm: NDArray[np.float32]
    facing: NDArray[np.float32]
    solid: NDArray[np.uint32]


class Raycaster:
    """Rays against a fixed set of meshes, all in one frame."""

    def __init__(self, meshes: list[SurfaceMesh]) -> None:
        self._o3d = load_open3d()
        self._scene: Any = self._o3d.t.geometry.RaycastingScene(nthreads=1)
        for mesh in meshes:
            self._scene.add_triangles(
                self._o3d.core.Tensor(mesh.vertices.astype(np.float32)),
                self._o3d.core.Tensor(mesh.faces.astype(np.uint32)),
            )

    def cast(self, camera: PinholeCamera, T_scene_camera: Array) -> Hits:
        """Cast one ray per pixel from the camera at `T_scene_camera`."""
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(np.float32)
        along = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
        R = T_scene_camera[:3, :3].astype(np.float32)
        rays = np.empty((*u.shape, 6), dtype=np.float32)
        rays[..., :3] = T_scene_camera[:3, 3]
        rays[..., 3:] = along @ R.T
        found = self._scene.cast_rays(self._o3d.core.Tensor(rays), nthreads=1)
        normal = found["primitive_normals"].numpy() @ invert(T_scene_camera)[:3, :3].T.astype(np.float32)
        facing = np.abs((normal * along).sum(-1)) / np.linalg.norm(along, axis=-1)
        return Hits(found["t_hit"].numpy(), np.minimum(facing, 1.0), found["geometry_ids"].numpy())
