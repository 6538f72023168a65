"""The strategies of the technique, each a field on the surface and its levels."""

from __future__ import annotations

from eddyscan.core.frames import Array
from eddyscan.core.technique import Plan
from eddyscan.planning.families import even_levels, plane_levels, ring_field, span_inside
from eddyscan.planning.geodesic import distance_from, field_mesh, geodesic_lines
from eddyscan.planning.levels import Line, clipped, level_lines
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.topology import edges_of

# Rows along x are cut by planes of constant y.
ALONG_X = 1


def lines_for(surface: SmoothSurface, settings: Plan, guard: Array) -> list[Line]:
    """Return the lines of the rows, ordered, cut to where `guard` (V,) is positive."""
    inside = guard > 0
    if not inside.any():
        return []
    if settings.strategy == "geodesic":
        mesh = field_mesh(surface)
        field = distance_from(mesh, next(mesh.seeds))
        return geodesic_lines(mesh, field, guard, settings.pitch_mm)
    edges = edges_of(surface.faces)
    if settings.strategy == "encircle":
        field = ring_field(surface, inside)
        levels = even_levels(0.0, span_inside(field, guard, edges)[1], settings.pitch_mm)
    elif settings.strategy == "grid":
        field = surface.vertices[:, ALONG_X]
        levels = even_levels(*span_inside(field, guard, edges), settings.pitch_mm)
    else:
        field = surface.vertices[:, ALONG_X]
        levels = plane_levels(surface, ALONG_X, settings.pitch_mm, inside, span_inside(field, guard, edges))
    lines = level_lines(surface.vertices, surface.faces, edges, field, levels, guard)
    return [piece for line in lines for piece in clipped(line)]
