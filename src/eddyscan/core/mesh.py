"""The surface of the part as a triangle mesh with stated uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, IntArray, apply, rotate


@dataclass(frozen=True)
class SurfaceMesh:
    """A triangle mesh, usually in the part frame.

    Attributes
    ----------
    vertices : (V, 3) float64 [mm]
    faces : (F, 3) int64
        Counter-clockwise seen from outside.
    normals : (V, 3) float64
        Unit outward normals.
    uncertainty_mm : (V,) float64 or None
        Standard uncertainty along the normal.
    frame : str
    """

    vertices: Array
    faces: IntArray
    normals: Array
    uncertainty_mm: Array | None = None
    frame: str = "part"

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise GeometryError(
                f"mesh arrays have shapes {self.vertices.shape} and {self.faces.shape}, needed are (V, 3) and (F, 3)."
            )
        if len(self.vertices) == 0 or len(self.faces) == 0:
            raise GeometryError(
                f"the mesh is empty: {len(self.vertices)} vertices, {len(self.faces)} faces. Check the file."
            )
        if not np.isfinite(self.vertices).all():
            bad = int((~np.isfinite(self.vertices).all(axis=1)).sum())
            raise GeometryError(f"{bad} of {len(self.vertices)} mesh vertices are NaN or infinite. Export it again.")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise GeometryError(
                f"the mesh's faces name vertex {int(self.faces.max())}, it has {len(self.vertices)}. Export it again."
            )
        if self.normals.shape != self.vertices.shape:
            raise GeometryError(f"{len(self.normals)} normals for {len(self.vertices)} vertices.")

    @classmethod
    def from_triangles(
        cls, vertices: Array, faces: IntArray, uncertainty_mm: Array | None = None, frame: str = "part"
    ) -> SurfaceMesh:
        """Build a mesh with area-weighted vertex normals."""
        vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        faces = np.ascontiguousarray(faces, dtype=np.int64)
        return cls(vertices, faces, vertex_normals(vertices, faces), uncertainty_mm, frame)

    @property
    def area_mm2(self) -> float:
        """Return the sum of the triangles' areas [mm^2]."""
        return float(0.5 * np.linalg.norm(face_vectors(self.vertices, self.faces), axis=1).sum())

    def moved(self, T_to_frame: Array, frame: str) -> SurfaceMesh:
        """Return the mesh in another frame."""
        return SurfaceMesh(
            apply(T_to_frame, self.vertices), self.faces, rotate(T_to_frame, self.normals), self.uncertainty_mm, frame
        )


def face_vectors(vertices: Array, faces: IntArray) -> Array:
    """Return (F, 3) face normals with twice the triangle's area as length."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def vertex_normals(vertices: Array, faces: IntArray) -> Array:
    """Return (V, 3) unit normals, each the area-weighted mean of its faces'."""
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise GeometryError(f"the mesh's faces name vertex {int(faces.max())}, it has {len(vertices)}.")
    flat = face_vectors(vertices, faces)
    normals = np.stack(
        [sum(np.bincount(faces[:, k], flat[:, axis], minlength=len(vertices)) for k in range(3)) for axis in range(3)],
        axis=1,
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(np.divide(normals, length, out=np.zeros_like(normals), where=length > 0))
