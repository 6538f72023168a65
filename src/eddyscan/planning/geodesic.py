"""Rows at constant distance on the surface: level sets of the distance from a seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.planning.fields import Gradients, Seed, distance_field, gradients
from eddyscan.planning.holes import Filled, fill_holes
from eddyscan.planning.seeds import seeds_for
from eddyscan.planning.smooth import SmoothSurface, smoothed
from eddyscan.planning.topology import Edges, edges_of
from eddyscan.planning.trace import exact_distance


@dataclass(frozen=True)
class FieldMesh:
    """A patch made ready for fields: holes closed, edges and calculus at hand."""

    filled: Filled
    edges: Edges
    calculus: Gradients
    seeds: Iterator[Seed]
    surface: SmoothSurface


def field_mesh(surface: SmoothSurface) -> FieldMesh:
    """Close the patch's holes and find seeds."""
    filled = fill_holes(surface.vertices, surface.faces, surface.normals)
    edges = edges_of(filled.faces)
    if filled.n_holes:
        surface = smoothed(filled.vertices, filled.faces, 2 * surface.radius_mm)
    return FieldMesh(filled, edges, gradients(filled.vertices, filled.faces), seeds_for(filled, edges), surface)


def distance_from(mesh: FieldMesh, seed: Seed) -> Array:
    """Return the signed distance (V',) [mm] from a seed over the filled mesh."""
    rough = distance_field(mesh.calculus, seed)
    return exact_distance(mesh.surface, rough, seed.rays, mesh.filled.edge_mm)


def guarded(mesh: FieldMesh, guard: Array) -> Array:
    """Carry a patch's guard (V,) to the filled mesh (V',): negative inside fillings."""
    extra = len(mesh.filled.vertices) - len(guard)
    whole = np.concatenate([guard, np.full(extra, np.inf)])
    return np.asarray(np.minimum(np.minimum(whole, mesh.filled.hole_mm), 1e6))
