"""All posed views to one mesh with a stated uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Surface
from eddyscan.surface.cells import HeightCells, cells_of_view
from eddyscan.surface.free_form import fuse_free_form
from eddyscan.surface.grid_mesh import inside_polygon, mesh_inside, without_vertices
from eddyscan.surface.height_field import HeightField, fit_height_field
from eddyscan.surface.part_frame import PartFrame
from eddyscan.surface.uncertainty import estimate_uncertainty
from eddyscan.surface.view import View

CELL_MM = 1.0
MAX_CELLS = 400_000
HOLE_REACH_MM = 3.0  # farther than this from any measured cell the surface is not delivered
HOLE_WORTH_MM2 = 20.0
STEEP_COSINES = (np.cos(np.radians(82.0)), np.cos(np.radians(60.0)))
STEEP_SHARE = 0.08


@dataclass(frozen=True)
class Fused:
    """The mesh in the part frame, what must be told about it, and how it was made."""

    mesh: SurfaceMesh
    warnings: tuple[str, ...]
    method: str


def fuse(views: Sequence[View], part: PartFrame, settings: Surface, *, progress: Progress = silent) -> Fused:
    """Fuse the views with the method the part asks for.

    A part is a height field when hardly any of its surface is steep without
    being a wall; then a robust spline, else 3-D moving least squares and Poisson.
    """
    progress("fusing the surface", 0, 1)
    if not is_height_field(views, part):
        mesh, warnings = fuse_free_form(views, part, settings)
        fused = Fused(mesh, warnings, "free form")
    else:
        fused = _fuse_height_field(views, part, settings)
    progress("fusing the surface", 1, 1)
    return fused


def is_height_field(views: Sequence[View], part: PartFrame) -> bool:
    """Say whether hardly any of the part's surface is steep without being a wall."""
    low, high = part.box(1.0)
    found = [v.surfels_in(part.T_part_world, low + np.array([0, 0, 1.0]), high)[1] for v in views]
    return _steep_share(np.concatenate(found)) <= STEEP_SHARE


def _steep_share(normals: Array) -> float:
    """Return the share of surface area between 60 and 82 degrees of slope."""
    if not len(normals):
        return 0.0
    steep = (normals[:, 2] > STEEP_COSINES[0]) & (normals[:, 2] < STEEP_COSINES[1])
    top = normals[:, 2] >= STEEP_COSINES[1]
    return float(steep.sum() / max(int(steep.sum() + top.sum()), 1))


def collect_cells(views: Sequence[View], part: PartFrame, *, cell_mm: float = CELL_MM) -> HeightCells:
    """Bin every view's points over the part, one view at a time: memory follows one view, not all."""
    size = part.size_mm[:2]
    cell = max(cell_mm, float(np.sqrt(size.prod() / MAX_CELLS)))
    n = np.maximum(np.round(size / cell).astype(int), 2)
    exact = size / n
    low, high = part.box(0.0)
    layers = [
        cells_of_view(
            *v.points_in(part.T_part_world, low, high + np.array([0, 0, 5.0])), np.zeros(2), exact, (n[0], n[1])
        )
        for v in views
    ]
    height, offset, weight = (np.stack([layer[k] for layer in layers]) for k in range(3))
    return HeightCells(height, offset, weight, exact, np.zeros(2))


def cells_inside(cells: HeightCells, part: PartFrame) -> NDArray[np.bool_]:
    """Return which cells (nx, ny) have their centre inside the outline."""
    x, y = cells.centres()
    centres = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return inside_polygon(centres, part.outline.polygon).reshape(cells.shape)


def _fuse_height_field(views: Sequence[View], part: PartFrame, settings: Surface) -> Fused:
    cells = collect_cells(views, part)
    inside = cells_inside(cells, part)
    if not (cells.weight.sum(axis=0)[inside] > 0).any():
        raise GeometryError("no view saw the top of the part: all cells inside its outline are empty. Take more views.")
    field = fit_height_field(cells, inside)
    xy, faces = mesh_inside(part.outline.polygon, settings.grid_mm)
    gap, warnings = _gaps(cells, field, inside)
    index = np.minimum((xy / cells.cell_mm).astype(int), np.array(cells.shape) - 1)
    used, faces = without_vertices(faces, gap[index[:, 0], index[:, 1]] > HOLE_REACH_MM)
    if not len(faces):
        raise GeometryError("too little of the part was seen to make a surface. Take more views.")
    xy = xy[used]
    vertices = np.stack([xy[:, 0], xy[:, 1], field.spline.at(xy[:, 0], xy[:, 1])], axis=1)
    slope = [field.spline.at(xy[:, 0], xy[:, 1], *d) for d in ((1, 0), (0, 1))]
    normals = np.stack([-slope[0], -slope[1], np.ones(len(xy))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uncertainty = estimate_uncertainty(field, cells).along_normal(xy, normals[:, 2])
    return Fused(SurfaceMesh(vertices, faces, normals, uncertainty), warnings, "height field")


def _gaps(cells: HeightCells, field: HeightField, inside: NDArray[np.bool_]) -> tuple[Array, tuple[str, ...]]:
    """Return the distance to the nearest measured cell [mm] and a warning that names the hole area."""
    seen = (field.weight.sum(axis=0) > 0) | ~inside
    gap = np.asarray(distance_transform_edt(~seen, sampling=list(cells.cell_mm)))
    hidden = (gap > HOLE_REACH_MM) & inside
    if not hidden.any():
        return gap, ()
    area = float(hidden.sum() * cells.cell_mm.prod())
    if area < HOLE_WORTH_MM2:
        return gap, ()
    where = np.argwhere(hidden).mean(axis=0) * cells.cell_mm
    return gap, (
        f"{area:.0f} mm2 of the part were seen by no view (round x = {where[0]:.0f}, y = {where[1]:.0f} mm); "
        "the mesh is open there. Take a view of that side.",
    )
