"""Where on the surface a reading looks: foot, smooth normal and curvature below the coil."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh

NEIGHBOURS = 40
FITS_PER_BLOCK = 4_000
SAME_SIDE = 0.5


@dataclass(frozen=True)
class Footing:
    """The surface below each reading.

    Attributes
    ----------
    foot_mm : (M, 3) [mm, part] nearest point of the smoothed surface
    normal : (M, 3) unit outward
    distance_mm : (M,) [mm] of the coil face's centre to the foot, along the normal
    tilt_deg : (M,) [deg] between the probe's axis and the normal
    curvature_per_mm : (M,) [1/mm] sum of the principal curvatures, convex positive
    """

    foot_mm: Array
    normal: Array
    distance_mm: Array
    tilt_deg: Array
    curvature_per_mm: Array


class SmoothSurface:
    """A mesh as quadrics fitted around a thinned set of its vertices.

    Camera noise in single normals does not reach tilt and distance.

    Parameters
    ----------
    mesh : SurfaceMesh
    radius_mm : float [mm]
        The fit's weights fall to exp(-2) here.
    """

    def __init__(self, mesh: SurfaceMesh, radius_mm: float = 6.0) -> None:
        self._mesh = mesh
        self._vertices = KDTree(mesh.vertices)
        self._centres = _thinned(mesh, radius_mm / 2)
        self._fits = _quadrics(mesh, self._vertices, self._centres, radius_mm)
        self._near_centre = KDTree(mesh.vertices[self._centres])

    def nearest_mm(self, points_mm: Array) -> float:
        """Return the distance [mm] of the nearest of points (M, 3) to the nearest vertex."""
        return float(np.min(self._vertices.query(points_mm)[0]))

    def below(self, points_mm: Array, *, axis: Array | None = None) -> Footing:
        """Return the surface below points (M, 3); arguments and errors of `footing`."""
        _require_near(self._vertices, points_mm)
        origin = self._mesh.vertices[self._centres]
        start = self._mesh.vertices[_query(self._vertices, points_mm)]
        foot, normal, curvature = _feet(origin, self._fits, _query(self._near_centre, start), points_mm)
        foot, normal, curvature = _feet(origin, self._fits, _query(self._near_centre, foot), points_mm)
        distance = ((points_mm - foot) * normal).sum(axis=1)
        cosine = np.ones(len(foot)) if axis is None else np.clip(-(normal @ axis), -1.0, 1.0)
        return Footing(foot, normal, distance, np.degrees(np.arccos(cosine)), curvature)


def footing(mesh: SurfaceMesh, points_mm: Array, *, axis: Array | None, radius_mm: float = 6.0) -> Footing:
    """Find where readings look, on a smooth fit of the mesh.

    Parameters
    ----------
    mesh : SurfaceMesh
    points_mm : (M, 3) coil face centres [mm, part]
    axis : (3,) direction of the probe [part], or None when the probe stands on the normal
    radius_mm : float [mm] size of the fit's window

    Raises
    ------
    GeometryError
        When most readings are nowhere near the mesh.
    """
    return SmoothSurface(mesh, radius_mm).below(points_mm, axis=axis)


def _query(tree: KDTree, points_mm: Array) -> IntArray:
    return np.asarray(tree.query(points_mm)[1], dtype=np.int64)


def _require_near(tree: KDTree, points_mm: Array, limit_mm: float = 50.0) -> None:
    distance, _ = tree.query(points_mm)
    if np.median(distance) > limit_mm:
        low, high = points_mm.min(axis=0), points_mm.max(axis=0)
        raise GeometryError(
            f"half of the readings are more than {np.median(distance):.0f} mm from the surface (limit {limit_mm:.0f}); "
            f"they span {np.round(low, 1).tolist()} to {np.round(high, 1).tolist()} mm in the part frame. "
            "The record and the surface belong to different parts, or T_stage_part is wrong: align again."
        )


@dataclass(frozen=True)
class _Quadrics:
    """Height a + b s + c t + (d s^2 + 2 e s t + f t^2) / 2 over a tangent frame, one per vertex."""

    frame: Array  # (K, 3, 3) rows: two tangents and the normal
    coefficient: Array  # (K, 6)


def _quadrics(mesh: SurfaceMesh, tree: KDTree, centres: IntArray, radius_mm: float) -> _Quadrics:
    frames, coefficients = [], []
    count = min(max(NEIGHBOURS, _within(mesh, radius_mm)), len(mesh.vertices))
    for start in range(0, len(centres), FITS_PER_BLOCK):
        block = centres[start : start + FITS_PER_BLOCK]
        distance, near = tree.query(mesh.vertices[block], k=count)
        same_side = np.einsum("kni,ki->kn", mesh.normals[near], mesh.normals[block]) > SAME_SIDE
        frame = tangent_frames((mesh.normals[near] * same_side[..., None]).sum(axis=1))
        local = np.einsum("kij,knj->kni", frame, mesh.vertices[near] - mesh.vertices[block][:, None])
        weight = np.exp(-2.0 * (distance / radius_mm) ** 2) * same_side
        frames.append(frame)
        coefficients.append(_fit(local, weight))
    return _Quadrics(np.concatenate(frames), np.concatenate(coefficients))


def _thinned(mesh: SurfaceMesh, cell_mm: float) -> IntArray:
    """Return one vertex per cubic cell: a quadric serves all points this near to it."""
    cell = np.floor(mesh.vertices / cell_mm).astype(np.int64)
    _, first = np.unique(cell, axis=0, return_index=True)
    return np.asarray(first, dtype=np.int64)


def _within(mesh: SurfaceMesh, radius_mm: float) -> int:
    """Return how many vertices lie within the radius on average (at most 200)."""
    return int(min(200, np.pi * radius_mm**2 * len(mesh.vertices) / mesh.area_mm2))


def _fit(local: Array, weight: Array) -> Array:
    s, t, z = local[..., 0], local[..., 1], local[..., 2]
    basis = np.stack([np.ones_like(s), s, t, s * s / 2, s * t, t * t / 2], axis=-1)
    weighted = basis * weight[..., None]
    normal = np.swapaxes(weighted, 1, 2) @ basis + 1e-9 * np.eye(6)
    return np.asarray(np.linalg.solve(normal, np.swapaxes(weighted, 1, 2) @ z[..., None])[..., 0])


def _feet(origin: Array, fits: _Quadrics, position: IntArray, points_mm: Array) -> tuple[Array, Array, Array]:
    """Return feet, normals and curvature sums by two Newton steps on the quadric below each point."""
    frame, coefficient = fits.frame[position], fits.coefficient[position]
    local = np.einsum("kij,kj->ki", frame, points_mm - origin[position])
    a, b, c, d, e, f = coefficient.T
    s, t = local[:, 0].copy(), local[:, 1].copy()
    for _ in range(3):
        height = a + b * s + c * t + (d * s * s + 2 * e * s * t + f * t * t) / 2
        slope_s, slope_t = b + d * s + e * t, c + e * s + f * t
        lift = (local[:, 2] - height) / (1 + slope_s**2 + slope_t**2)
        s, t = local[:, 0] + lift * slope_s, local[:, 1] + lift * slope_t
    height = a + b * s + c * t + (d * s * s + 2 * e * s * t + f * t * t) / 2
    slope_s, slope_t = b + d * s + e * t, c + e * s + f * t
    upward = np.stack([-slope_s, -slope_t, np.ones_like(s)], axis=1)
    norm = np.linalg.norm(upward, axis=1, keepdims=True)
    normal = np.einsum("kji,kj->ki", frame, upward / norm)
    foot = origin[position] + np.einsum("kji,kj->ki", frame, np.stack([s, t, height], axis=1))
    twice_mean = ((1 + slope_t**2) * d - 2 * slope_s * slope_t * e + (1 + slope_s**2) * f) / norm[:, 0] ** 3
    return foot, normal, -twice_mean


def tangent_frames(normals: Array) -> Array:
    """Return (K, 3, 3) right-handed frames: rows are two tangents, the first nearest to x, and the normal."""
    normal = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    first = np.array([1.0, 0.0, 0.0]) - normal * normal[:, :1]
    steep = np.linalg.norm(first, axis=1) < 0.1
    first[steep] = np.array([0.0, 1.0, 0.0]) - normal[steep] * normal[steep, 1:2]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first), normal], axis=1)
