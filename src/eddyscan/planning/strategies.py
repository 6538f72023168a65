"""The strategies of the technique: each a field on the surface whose levels are the rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.technique import Plan
from eddyscan.planning.families import (
    STEEPEST_PLANE,
    STEEPEST_RING,
    even_levels,
    ring_field,
    span_inside,
    spread_levels,
)
from eddyscan.planning.geodesic import distance_from, field_mesh, guarded
from eddyscan.planning.levels import Line, clipped, level_lines
from eddyscan.planning.loops import fitted_loops
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.topology import Edges, edges_of

# Rows along x are cut by planes of constant y.
ALONG_X = 1


@dataclass(frozen=True)
class RowField:
    """A field on a mesh, where it counts, and the levels that become rows.

    Attributes
    ----------
    vertices : (V, 3) [mm], faces : (F, 3), edges : Edges
        The patch's own vertices and faces come first.
    field : (V,), guard : (V,) positive where rows may run
    levels : (L,) ascending
    """

    vertices: Array
    faces: IntArray
    edges: Edges
    field: Array
    guard: Array
    levels: Array

    def lines_at(self, levels: Array) -> list[Line]:
        """Return the level lines, ordered by level and cut to the guarded region."""
        lines = level_lines(self.vertices, self.faces, self.edges, self.field, levels, self.guard)
        return [piece for line in lines for piece in clipped(line)]

    def rows(self, settings: Plan) -> list[Line]:
        """Return the lines of all rows; closed ones fitted to a whole number of steps."""
        lines = self.lines_at(self.levels)
        if settings.strategy == "grid":
            return lines
        return fitted_loops(lines, self.lines_at, step_mm=settings.step_mm, pitch_mm=settings.pitch_mm)


def row_fields(surface: SmoothSurface, settings: Plan, guard: Array) -> Iterator[RowField]:
    """Yield the ways to lay rows on a patch, the most promising first; nothing when the guard leaves nothing."""
    inside = guard > 0
    if not inside.any():
        return
    if settings.strategy == "geodesic":
        yield from _geodesic(surface, settings, guard)
        return
    edges = edges_of(surface.faces)
    field, along = surface.vertices[:, ALONG_X], surface.normals[:, ALONG_X]
    if settings.strategy == "encircle":
        field, along = ring_field(surface, inside)
    low, high = span_inside(field, guard, edges)
    if settings.strategy == "grid":
        levels = even_levels(low, high, settings.pitch_mm)
    else:
        steepest = STEEPEST_RING if settings.strategy == "encircle" else STEEPEST_PLANE
        levels = spread_levels(field[inside], along[inside], settings.pitch_mm, (low, high), steepest=steepest)
    yield RowField(surface.vertices, surface.faces, edges, field, guard, levels)


def _geodesic(surface: SmoothSurface, settings: Plan, guard: Array) -> Iterator[RowField]:
    mesh = field_mesh(surface)
    whole = guarded(mesh, guard)
    if not (whole > 0).any():
        return
    for seed in mesh.seeds:
        field = distance_from(mesh, seed)
        levels = even_levels(*span_inside(field, whole, mesh.edges), settings.pitch_mm)
        yield RowField(mesh.filled.vertices, mesh.filled.faces, mesh.edges, field, whole, levels)
