"""Deviation of a surface from a nominal one, in the delivered frame and after best fit: always both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, apply, from_rotation_vector
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart
from eddyscan.core.progress import Progress, silent
from eddyscan.surface.open3d_adapter import closest_on_mesh

COVER_MM = 1.5  # a nominal spot is covered when the mesh comes this near, sideways
FIT_ROUNDS = 25
FIT_LIMIT = 20_000
LEVER_MM = 60.0  # scales rotations to mm
FREE_SHARE = 1e-3  # mean squared normal component below which a direction is free

Closest = Callable[[Array], tuple[Array, Array, Array]]


@dataclass(frozen=True)
class Deviation:
    """Distances of the mesh's vertices to the nominal surface, along the nominal normal.

    Attributes
    ----------
    mean_abs_mm, rmse_mm, p95_mm, max_mm : over vertices whose foot lies on the nominal surface
    coverage : share of the nominal surface that the mesh covers
    aligned : False in the delivered frame, True after best fit
    T_nominal_mesh : (4, 4) used
    signed_mm : (V,) positive outside; NaN beyond the nominal's outline
    overhang : share of vertices beyond the nominal's outline
    """

    mean_abs_mm: float
    rmse_mm: float
    p95_mm: float
    max_mm: float
    coverage: float
    aligned: bool
    T_nominal_mesh: Array
    signed_mm: Array
    overhang: float


@dataclass(frozen=True)
class Comparison:
    """The same mesh against the same nominal in both frames."""

    own: Deviation
    fit: Deviation


def compare(mesh: SurfaceMesh, nominal: NominalPart | SurfaceMesh, *, progress: Progress = silent) -> Comparison:
    """Compare a mesh with a nominal surface.

    Parameters
    ----------
    mesh : SurfaceMesh [mm, part]
    nominal : exact named part, or a mesh in the same frame

    Returns
    -------
    Comparison
        `own` in the frame as delivered, `fit` after a six-parameter best fit
        (point to plane, robust start, then plain least squares).
    """
    closest, samples = _nominal(nominal)
    progress("comparing", 0, 2)
    own = _deviation(mesh, closest, samples, np.eye(4), aligned=False)
    progress("comparing", 1, 2)
    fit = _deviation(mesh, closest, samples, _best_fit(mesh.vertices, closest), aligned=True)
    progress("comparing", 2, 2)
    return Comparison(own, fit)


def _nominal(nominal: NominalPart | SurfaceMesh) -> tuple[Closest, Array]:
    if isinstance(nominal, NominalPart):
        return nominal.closest, nominal.top_mesh(1.0).vertices
    return _MeshClosest(nominal), nominal.vertices


class _MeshClosest:
    """Closest points of a triangle mesh."""

    def __init__(self, mesh: SurfaceMesh) -> None:
        self._find = closest_on_mesh(mesh.vertices, mesh.faces)

    def __call__(self, points: Array) -> tuple[Array, Array, Array]:
        foot, normal = self._find(points)
        return foot, normal, np.asarray(((points - foot) * normal).sum(axis=1))


def _on_surface(points: Array, foot: Array, distance: Array) -> NDArray[np.bool_]:
    """Return which points have their foot inside the outline: the whole way to it is along the normal."""
    total = np.linalg.norm(points - foot, axis=1)
    sideways = np.sqrt(np.maximum(total**2 - distance**2, 0.0))
    return np.asarray(sideways < 0.05)


def _best_fit(vertices: Array, closest: Closest) -> Array:
    step = max(1, len(vertices) // FIT_LIMIT)
    points = vertices[::step]
    T = np.eye(4)
    for k in range(FIT_ROUNDS):
        moved = apply(T, points)
        foot, normal, distance = closest(moved.copy())
        use = _on_surface(moved, foot, distance)
        if use.sum() < 6:
            raise GeometryError(
                f"{int(use.sum())} of {len(points)} vertices lie over the nominal surface (need 6): "
                "the mesh is not in the part frame, or the units differ."
            )
        centre = moved[use].mean(axis=0)
        rows = np.concatenate([np.cross(moved[use] - centre, normal[use]) / LEVER_MM, normal[use]], axis=1)
        scale = max(1e-6, 1.4826 * float(np.median(np.abs(distance[use]))))
        weight = 1.0 / (1.0 + (distance[use] / (3 * scale)) ** 2) if k < 8 else np.ones(int(use.sum()))
        A = rows.T @ (weight[:, None] * rows)
        # Directions the shape leaves free (a wave along its crests) stay as delivered.
        values, vectors = np.linalg.eigh(A)
        free = values < FREE_SHARE * weight.sum()
        inverse = np.where(free, 0.0, 1.0 / np.maximum(values, 1e-12))
        twist = vectors @ (inverse * (vectors.T @ (rows.T @ (-weight * distance[use]))))
        small = from_rotation_vector(twist[:3] / LEVER_MM, np.zeros(3))
        small[:3, 3] = centre - small[:3, :3] @ centre + twist[3:]
        T = small @ T
        if np.abs(twist[3:]).max() < 1e-5 and k > 10:
            break
    return T


def _deviation(mesh: SurfaceMesh, closest: Closest, samples: Array, T: Array, *, aligned: bool) -> Deviation:
    points = apply(T, mesh.vertices)
    foot, _, distance = closest(points.copy())
    on = _on_surface(points, foot, distance)
    if not on.any():
        raise GeometryError("no vertex of the mesh lies over the nominal surface: check the frame and the units.")
    size = np.abs(distance[on])
    reach, _ = KDTree(points).query(samples, distance_upper_bound=50.0)
    rmse = float(np.sqrt(np.mean(size**2)))
    covered = float(np.mean(reach < COVER_MM + 3 * rmse))
    return Deviation(
        float(size.mean()),
        rmse,
        float(np.quantile(size, 0.95)),
        float(size.max()),
        covered,
        aligned,
        T,
        np.where(on, distance, np.nan),
        float(1 - on.mean()),
    )
