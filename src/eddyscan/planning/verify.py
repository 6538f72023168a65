"""Whether the strokes cover the surface: an independent dense check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray
from eddyscan.planning.strokes import Stroke, surface_distance

SAMPLES_PER_FOOTPRINT = 40
MIN_SAMPLES, MAX_SAMPLES = 20_000, 400_000
NEIGHBOURS = 12


@dataclass(frozen=True)
class Samples:
    """Area-uniform spots of a mesh.

    Attributes
    ----------
    points, normals : (N, 3), face : (N,), weight : (N, 3) barycentric
    area_mm2 : float, that each speaks for
    reach_mm : float, half the swept width
    """

    points: Array
    normals: Array
    face: IntArray
    weight: Array
    area_mm2: float
    reach_mm: float

    def of(self, values: Array, faces: IntArray) -> Array:
        """Return a vertex field (V,) at the samples (N,); infinite values count as very large."""
        return np.asarray(np.einsum("nk,nk->n", self.weight, np.minimum(values, 1e6)[faces[self.face]]))


def dense_samples(vertices: Array, faces: IntArray, normals: Array, footprint_mm: float) -> Samples:
    """Return area-uniform samples of a mesh, many per footprint; the same for the same mesh."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = float(area.sum())
    wanted = SAMPLES_PER_FOOTPRINT * total / max(footprint_mm, 1e-9) ** 2
    n = int(np.clip(wanted, MIN_SAMPLES, MAX_SAMPLES))
    random = np.random.default_rng(20261122)
    # Stratified along the running area, so every patch gets its share.
    at = (np.arange(n) + random.random(n)) * total / n
    face = np.minimum(np.searchsorted(np.cumsum(area), at), len(faces) - 1)
    r, t = np.sqrt(random.random(n)), random.random(n)
    weight = np.stack([1 - r, r * (1 - t), r * t], axis=1)
    points = np.einsum("nk,nkj->nj", weight, vertices[faces[face]])
    normal = np.einsum("nk,nkj->nj", weight, normals[faces[face]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return Samples(points, normal, face, weight, total / n, footprint_mm / 2 * (1 + 1e-3))


def distance_to_strokes(samples: Samples, strokes: list[Stroke], fine_mm: float) -> Array:
    """Return each sample's distance (N,) [mm] on the surface to the nearest stroke; inf without strokes."""
    if not strokes:
        return np.full(len(samples.points), np.inf)
    paths = [densified(stroke, fine_mm) for stroke in strokes]
    points = np.concatenate([p for p, _, _ in paths])
    normals = np.concatenate([n for _, n, _ in paths])
    last = np.concatenate([np.arange(len(p)) == len(p) - 1 for p, _, _ in paths])
    _, nearest = KDTree(points).query(samples.points, k=min(4, len(points)))
    nearest = nearest.reshape(len(samples.points), -1)
    best = np.full(len(samples.points), np.inf)
    for column in nearest.T:
        for start in (column, np.maximum(column - 1, 0)):
            end = np.where(last[start], start, np.minimum(start + 1, len(points) - 1))
            foot, normal = _foot(samples.points, points[start], points[end], normals[start], normals[end])
            # The far side of a thin wall is near in space only.
            same_side = np.einsum("nk,nk->n", normal, samples.normals) > 0.2
            d = surface_distance(samples.points, foot, samples.normals, normal)
            best = np.minimum(best, np.where(same_side, d, np.inf))
    return best


def _foot(p: Array, a: Array, b: Array, n_a: Array, n_b: Array) -> tuple[Array, Array]:
    d = b - a
    t = np.einsum("nk,nk->n", p - a, d) / np.maximum(np.einsum("nk,nk->n", d, d), 1e-12)
    t = np.clip(t, 0, 1)[:, None]
    normal = n_a + t * (n_b - n_a)
    return a + t * d, normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def densified(stroke: Stroke, fine_mm: float) -> tuple[Array, Array, Array]:
    """Return the way swept from reading to reading, every `fine_mm` or so: points, normals, tangents.

    Between two readings the probe runs straight on the surface: a cubic that
    leaves and arrives in the tangent planes (Hermite).
    """
    p, n = stroke.points, stroke.normals
    if len(p) == 1:
        return p, n, np.zeros_like(p)
    chord = np.diff(p, axis=0)
    length = np.maximum(surface_distance(p[:-1], p[1:], n[:-1], n[1:]), 1e-12)
    m = max(1, int(np.ceil(float(length.max()) / fine_mm)))
    t = (np.arange(m) / m)[:, None]
    leave, arrive = _within(chord, n[:-1], length), _within(chord, n[1:], length)
    points = _hermite(p[:-1], leave, p[1:], arrive, t).reshape(-1, 3)
    normals = (n[:-1, None] + t * np.diff(n, axis=0)[:, None]).reshape(-1, 3)
    points, normals = np.concatenate([points, p[-1:]]), np.concatenate([normals, n[-1:]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    tangents = np.gradient(points, axis=0)
    return points, normals, tangents / np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-12)


def _within(chord: Array, normal: Array, length: Array) -> Array:
    flat = chord - np.einsum("nk,nk->n", chord, normal)[:, None] * normal
    return np.asarray(flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12) * length[:, None])


def _hermite(p: Array, dp: Array, q: Array, dq: Array, t: Array) -> Array:
    p, dp, q, dq = (v[:, None] for v in (p, dp, q, dq))
    return np.asarray(
        (2 * t**3 - 3 * t**2 + 1) * p + (t**3 - 2 * t**2 + t) * dp + (3 * t**2 - 2 * t**3) * q + (t**3 - t**2) * dq
    )


def spacings(strokes: list[Stroke]) -> Array:
    """Return all distances on the surface between consecutive readings of a row [mm]."""
    parts = [np.empty(0)]
    for stroke in strokes:
        p, n = stroke.points, stroke.normals
        parts.append(surface_distance(p[:-1], p[1:], n[:-1], n[1:]))
    return np.concatenate(parts)


def row_distances(strokes: list[Stroke], pitch_mm: float, *, probes: int = 2000) -> Array:
    """Return distances [mm] from spots along rows to the next strand on either side.

    A strand counts where it is seen within 30 degrees of straight across.
    """
    if not strokes:
        return np.empty(0)
    paths = [densified(stroke, pitch_mm / 8) for stroke in strokes]
    points, normals, tangents = (np.concatenate(column) for column in zip(*paths, strict=True))
    ask = np.linspace(0, len(points) - 1, min(probes, len(points))).astype(np.int64)
    k = min(100, len(points))
    distance, index = KDTree(points).query(points[ask], k=k, distance_upper_bound=2.2 * pitch_mm)
    found = np.isfinite(distance)
    index = np.where(found, index, 0)
    across = np.cross(normals[ask], tangents[ask])
    offset = points[index] - points[ask][:, None]
    lateral = np.einsum("nkj,nj->nk", offset, across)
    same_side = np.einsum("nkj,nj->nk", normals[index], normals[ask]) > 0.2
    d = surface_distance(points[ask][:, None], points[index], normals[ask][:, None], normals[index])
    apart = found & same_side & (np.abs(lateral) > np.cos(np.radians(30)) * distance) & (distance > pitch_mm / 4)
    sides = [np.where(apart & side, d, np.inf).min(axis=1) for side in (lateral > 0, lateral < 0)]
    both = np.concatenate(sides)
    return np.asarray(both[np.isfinite(both)])
