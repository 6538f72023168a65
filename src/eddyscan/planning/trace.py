"""Straightest lines on the smooth surface: they carry the exact distance from a seed curve.

A field from the mesh's triangles is good to a few hundredths of a millimetre.
Lines that leave the seed square and run straight on the smooth surface know
their length to a micrometre; vertices beside them take it over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.planning.smooth import SmoothSurface

# The rough field errs with the mesh: rays may differ by this and a share of an edge.
AGREEMENT_MM, AGREEMENT_OF_EDGE = 0.3, 0.4
FADE_MM = 5.0
NEIGHBOURS = 3


@dataclass(frozen=True)
class Rays:
    """Where lines start and which way they leave: points, ways (K, 3) unit, in the surface; sign of the distance."""

    start: Array
    way: Array
    sign: float


def exact_distance(surface: SmoothSurface, field: Array, rays: list[Rays], step_mm: float) -> Array:
    """Return the field (V,) [mm] with the exact distance wherever a ray comes by and agrees with it."""
    tree = KDTree(surface.vertices)
    result, known = field.copy(), np.zeros(len(field), dtype=bool)
    for bundle in rays:
        side = field * bundle.sign
        points, ways, s = _traced(surface, tree, bundle, float(side.max()) + step_mm, step_mm)
        if len(points) == 0:
            continue
        found = KDTree(points).query(surface.vertices, k=min(4, len(points)), distance_upper_bound=1.5 * step_mm)
        near, index = (np.asarray(column).reshape(len(field), -1) for column in found)
        valid = np.isfinite(near)
        index = np.where(valid, index, 0)
        ahead = np.einsum("vkj,vkj->vk", surface.vertices[:, None] - points[index], ways[index])
        weight = valid / (np.where(valid, near, 1.0) ** 2 + 1e-6)
        # Rays beyond a ridge came the longer way round: the field tells them off.
        weight *= np.abs(s[index] + ahead - side[:, None]) < AGREEMENT_MM + AGREEMENT_OF_EDGE * step_mm
        total = weight.sum(axis=1)
        better = total > 0
        exact = (weight * (s[index] + ahead)).sum(axis=1) / np.where(better, total, 1.0)
        result[better] = bundle.sign * exact[better]
        known |= better
    return _spread(surface, field, result, known)


def _spread(surface: SmoothSurface, field: Array, result: Array, known: BoolArray) -> Array:
    """Let the correction fade out over a few mm where no ray comes by."""
    if known.all() or not known.any():
        return result
    near, index = (np.asarray(c) for c in KDTree(surface.vertices[known]).query(surface.vertices[~known]))
    result[~known] += np.exp(-near / FADE_MM) * (result - field)[known][index]
    return result


def _traced(
    surface: SmoothSurface, tree: KDTree, rays: Rays, length_mm: float, step_mm: float
) -> tuple[Array, Array, Array]:
    """Return points, ways (N, 3) and lengths run (N,) along all rays until they leave the surface."""
    x, t, s = rays.start, rays.way, np.zeros(len(rays.start))
    kept = [(x, t, s)]
    for _ in range(int(np.ceil(length_mm / step_mm))):
        near, vertex = (np.asarray(column) for column in tree.query(x, k=NEIGHBOURS))
        here = near[:, 0] < 1.6 * step_mm
        if not here.any():
            break
        x, t, s, near, vertex = x[here], t[here], s[here], near[here], vertex[here]
        bend = _bend(surface, vertex[:, 0], t)
        y = x + step_mm * t + 0.5 * step_mm**2 * bend[:, None] * surface.normals[vertex[:, 0]]
        near, vertex = (np.asarray(column) for column in tree.query(y, k=NEIGHBOURS))
        y, normal = _dropped(surface, y, vertex, near)
        chord = y - x
        length = np.linalg.norm(chord, axis=1)
        c = chord / np.maximum(length, 1e-12)[:, None]
        # On a circular arc the way at the end mirrors the way at the start over the chord.
        after = 2 * np.einsum("nk,nk->n", t, c)[:, None] * c - t
        after -= np.einsum("nk,nk->n", after, normal)[:, None] * normal
        after /= np.maximum(np.linalg.norm(after, axis=1, keepdims=True), 1e-12)
        half = 0.5 * np.arccos(np.clip(np.einsum("nk,nk->n", t, after), -1, 1))
        s = s + length * np.where(half > 1e-6, half / np.maximum(np.sin(half), 1e-12), 1.0)
        x, t = y, after
        kept.append((x, t, s))
    points, ways, lengths = (np.concatenate(column) for column in zip(*kept, strict=True))
    return points, ways, lengths


def _bend(surface: SmoothSurface, vertex: IntArray, way: Array) -> Array:
    """Return the normal curvature (N,) [1/mm] along a way, positive towards the normal."""
    t, q = surface.tangents[vertex], surface.quadric[vertex]
    a, b = np.einsum("nk,nk->n", way, t[:, 0]), np.einsum("nk,nk->n", way, t[:, 1])
    return np.asarray(q[:, 0] * a * a + 2 * q[:, 1] * a * b + q[:, 2] * b * b)


def _dropped(surface: SmoothSurface, points: Array, vertex: IntArray, near: Array) -> tuple[Array, Array]:
    """Return points (N, 3) dropped on the blended fits of their nearest vertices, and the normals there."""
    weight = 1 / (near**2 + 1e-4)
    weight /= weight.sum(axis=1, keepdims=True)
    where, normal = np.zeros_like(points), np.zeros_like(points)
    for k in range(vertex.shape[1]):
        P, n = surface.lifted(points, vertex[:, k])
        where += weight[:, k, None] * P
        normal += weight[:, k, None] * n
    return where, normal / np.linalg.norm(normal, axis=1, keepdims=True)
