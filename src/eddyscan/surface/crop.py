"""Manual crop and rotation, the study's way."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.technique import Crop
from eddyscan.surface.grid_mesh import without_vertices


def cropped(mesh: SurfaceMesh, crop: Crop) -> SurfaceMesh:
    """Return the mesh turned about x, y, z [deg] and without what lies outside the limits [mm, part frame].

    Raises
    ------
    TechniqueError
        When the crop leaves nothing.
    """
    if any(crop.rotate_xyz_deg):
        R = Rotation.from_euler("xyz", crop.rotate_xyz_deg, degrees=True).as_matrix()
        mesh = mesh.moved(transform(R), mesh.frame)
    outside = np.zeros(len(mesh.vertices), dtype=bool)
    for k, limits in enumerate((crop.x_mm, crop.y_mm, crop.z_mm)):
        if limits is not None:
            outside |= (mesh.vertices[:, k] < min(limits)) | (mesh.vertices[:, k] > max(limits))
    used, faces = without_vertices(mesh.faces, outside)
    if not len(faces):
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        raise TechniqueError(
            f"[surface.crop] leaves nothing of the surface, which spans x {low[0]:.0f} to {high[0]:.0f}, "
            f"y {low[1]:.0f} to {high[1]:.0f}, z {low[2]:.0f} to {high[2]:.0f} mm. Widen its limits."
        )
    sigma = None if mesh.uncertainty_mm is None else mesh.uncertainty_mm[used]
    return SurfaceMesh(mesh.vertices[used], faces, mesh.normals[used], sigma, mesh.frame)
