"""Distance fields on a mesh: geodesic distance from a seed, to well under a percent.

The first guess is the heat method (Crane, Weischedel, Wardetzky 2013). Policy
iteration sharpens it: with the way X the distance grows known, it solves
X . grad(phi) = 1 by least squares, may take the new way from
the result and go again. An error in the way enters the distance squared, so one round does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix
from scipy.sparse.linalg import splu

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.planning.trace import Rays

# Share of plain smoothing kept across the way of growth, round by round.
ACROSS = (0.1,)


@dataclass(frozen=True)
class Gradients:
    """Piecewise linear calculus on a mesh.

    Attributes
    ----------
    faces : (F, 3), area_mm2 : (F,)
    hat : (F, 3, 3) gradient [1/mm] of each corner's hat function
    n_vertices : int
    """

    faces: IntArray
    area_mm2: Array
    hat: Array
    n_vertices: int

    def of(self, values: Array) -> Array:
        """Return the gradient (F, 3) of a vertex field (V,)."""
        return np.asarray(np.einsum("fik,fi->fk", self.hat, values[self.faces]))

    def matrix(self, local: Array) -> csc_matrix:
        """Sum (F, 3, 3) corner matrices into a sparse (V, V) one."""
        rows = np.repeat(self.faces, 3, axis=1).ravel()
        columns = np.tile(self.faces, (1, 3)).ravel()
        shape = (self.n_vertices, self.n_vertices)
        return coo_matrix((local.ravel(), (rows, columns)), shape=shape).tocsc()

    def vector(self, local: Array) -> Array:
        """Sum (F, 3) corner values into (V,)."""
        return np.bincount(self.faces.ravel(), local.ravel(), minlength=self.n_vertices).astype(np.float64)


def gradients(vertices: Array, faces: IntArray) -> Gradients:
    """Return the calculus of a mesh (slivers get a vanishing weight, never a division by zero)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    twice = np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    normal /= twice[:, None]
    hat = np.stack([np.cross(normal, c - b), np.cross(normal, a - c), np.cross(normal, b - a)], axis=1)
    return Gradients(faces, twice / 2, hat / twice[:, None, None], len(vertices))


@dataclass(frozen=True)
class Seed:
    """Where distance is known, and how it leaves.

    Attributes
    ----------
    vertex : (K,), distance_mm : (K,) signed, side : (V,) sign of the distance
    rays : list of Rays, square to the seed
    """

    vertex: IntArray
    distance_mm: Array
    side: Array
    rays: list[Rays] = field(default_factory=list)


def distance_field(mesh: Gradients, seed: Seed) -> Array:
    """Return the signed geodesic distance (V,) [mm] from a seed.

    Raises
    ------
    GeometryError
        When the mesh has parts no seed can reach.
    """
    fixed = np.zeros(mesh.n_vertices, dtype=bool)
    fixed[seed.vertex] = True
    phi = np.zeros(mesh.n_vertices)
    phi[seed.vertex] = seed.distance_mm
    stiffness = np.einsum("f,fik,fjk->fij", mesh.area_mm2, mesh.hat, mesh.hat)
    way = _heat_way(mesh, stiffness, fixed) * np.sign(seed.side[mesh.faces].sum(axis=1))[:, None]
    for across in ACROSS:
        along = np.einsum("fik,fk->fi", mesh.hat, way)
        weight = (1 - across) * mesh.area_mm2[:, None, None]
        matrix = mesh.matrix(weight * along[:, :, None] * along[:, None, :] + across * stiffness)
        phi = _solved(matrix, mesh.vector(mesh.area_mm2[:, None] * along), phi, fixed)
        way = _unit(mesh.of(phi))
    return phi


def _heat_way(mesh: Gradients, stiffness: Array, fixed: BoolArray) -> Array:
    """Return the unit way (F, 3) away from the seed: heat held at 1 there falls off along it."""
    edge2 = float(np.median(mesh.area_mm2)) * 2.3
    mass = mesh.vector(np.repeat(mesh.area_mm2[:, None] / 3, 3, axis=1))
    diagonal = csc_matrix((mass, (np.arange(len(mass)), np.arange(len(mass)))), shape=(len(mass), len(mass)))
    heat = fixed.astype(float)
    heat = _solved(diagonal + 4 * edge2 * mesh.matrix(stiffness), np.zeros(len(mass)), heat, fixed)
    # The logarithm keeps the way where heat has almost vanished.
    return _unit(-mesh.of(np.log(np.maximum(heat, 1e-290))))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _solved(matrix: Any, right: Array, known: Array, fixed: BoolArray) -> Array:
    """Solve for the vertices that are not fixed."""
    free = np.flatnonzero(~fixed)
    if free.size == 0:
        return known
    rows = matrix[free]
    symmetric = {"SymmetricMode": True}
    try:
        factor = splu(rows[:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    except RuntimeError as error:
        raise GeometryError(
            f"no distance can be found on this mesh ({error}): some of its {len(free)} vertices hang on no face "
            "that joins them to the rest. Remove loose pieces and faces without area."
        ) from error
    solved = known.copy()
    solved[free] = factor.solve(right[free] - rows[:, np.flatnonzero(fixed)] @ known[fixed])
    return solved
