"""Mesh files: binary PLY with the uncertainty per vertex; STL, OBJ and others read through trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.frames import IntArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.formats.ply import PlyData, read_ply, write_ply

READABLE = (".ply", ".stl", ".obj", ".off", ".glb", ".3mf")
UNCERTAINTY = "uncertainty_mm"


def read_mesh(path: Path | str, *, frame: str = "part") -> SurfaceMesh:
    """Read a mesh [mm].

    Parameters
    ----------
    path : PLY (normals and `uncertainty_mm` kept when there), STL or OBJ (vertices merged)

    Raises
    ------
    FileError
        Missing, empty, truncated, of another kind, or without faces.
    GeometryError
        NaN vertices or faces that name vertices which do not exist.
    """
    path = Path(path)
    if not path.exists():
        raise FileError(f"{path} does not exist. Check the name.")
    if path.is_dir() or path.suffix.lower() not in READABLE:
        raise FileError(f"{path} is no mesh file; readable are {', '.join(READABLE)}.")
    data = path.read_bytes()
    if not data:
        raise FileError(f"{path} is empty (0 bytes). Export it again.")
    if path.suffix.lower() == ".ply":
        return _from_ply(path, read_ply(path, data), frame)
    return _from_trimesh(path, frame)


def write_mesh(mesh: SurfaceMesh, path: Path | str) -> None:
    """Write a binary PLY: x, y, z as double [mm], normals and `uncertainty_mm` as float."""
    path = Path(path)
    if path.suffix.lower() != ".ply":
        raise FileError(f"{path}: meshes are written as .ply; name it {path.stem}.ply.")
    columns = {name: mesh.vertices[:, k] for k, name in enumerate("xyz")}
    columns |= {name: mesh.normals[:, k] for k, name in enumerate(("nx", "ny", "nz"))}
    if mesh.uncertainty_mm is not None:
        columns[UNCERTAINTY] = mesh.uncertainty_mm
    write_ply(path, columns, mesh.faces, (f"frame {mesh.frame}", "unit mm"))


def _from_ply(path: Path, data: PlyData, frame: str) -> SurfaceMesh:
    points = data.columns("x", "y", "z")
    if points is None:
        raise FileError(f"{path} has vertices without x, y, z. Export it again.")
    if not len(data.faces):
        raise FileError(
            f"{path} has {len(points)} points but no faces: it is a point cloud. Give it as a view instead."
        )
    mesh = SurfaceMesh.from_triangles(points, _checked_faces(path, data.faces, len(points)), frame=frame)
    normals = data.columns("nx", "ny", "nz")
    if normals is None or not np.isfinite(normals).all():
        normals = mesh.normals
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.5, normals / np.maximum(length, 1e-12), mesh.normals)
    return SurfaceMesh(mesh.vertices, mesh.faces, normals, data.vertex.get(UNCERTAINTY), frame)


def _checked_faces(path: Path, faces: IntArray, count: int) -> IntArray:
    if faces.min() < 0 or faces.max() >= count:
        worst = int(faces.max()) if faces.max() >= count else int(faces.min())
        raise GeometryError(f"{path}: a face names vertex {worst}, the file has {count}. Export it again.")
    return faces


def _from_trimesh(path: Path, frame: str) -> SurfaceMesh:
    import trimesh

    try:
        loaded = trimesh.load(path, force="mesh", process=True)
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise FileError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}. Export it again.") from None
    if not isinstance(loaded, trimesh.Trimesh) or not len(loaded.faces):
        raise FileError(f"{path} holds no triangles. Export the surface, not curves or points.")
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    return SurfaceMesh.from_triangles(
        np.asarray(loaded.vertices), np.asarray(loaded.faces, dtype=np.int64), frame=frame
    )
