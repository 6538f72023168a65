"""What a plan is worth on the exact surface: measured apart from the planner's own check."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from benchmarks.planning_surfaces import Truth
from eddyscan.core.frames import Array
from eddyscan.core.plan import ScanPlan


@dataclass(frozen=True)
class Measures:
    """Figures of one plan; lengths in mm, angles in deg, shares 0-1."""

    swept: float
    cover_radius_mm: float
    spacing_error_mm: float
    rows_within_5_percent: float
    normal_mean_deg: float
    normal_max_deg: float
    points_ratio: float
    off_surface_mm: float
    scan_mm: float
    n_rows: int


def rows_of(plan: ScanPlan) -> list[Array]:
    """Return the readings' spots (n, 3) of every row."""
    scan = plan.is_scan
    cuts = np.flatnonzero(np.diff(plan.row[scan])) + 1
    return np.split(plan.surface_mm[scan], cuts)


def arc(p: Array, q: Array, n_p: Array, n_q: Array) -> Array:
    """Return surface distances from chords and exact normals (circular arc)."""
    half = 0.5 * np.arccos(np.clip(np.einsum("...k,...k->...", n_p, n_q), -1, 1))
    chord = np.linalg.norm(q - p, axis=-1)
    return np.asarray(chord * np.where(half > 1e-6, half / np.sin(np.maximum(half, 1e-12)), 1.0))


def measured(rows: list[Array], normals: Array, truth: Truth, *, pitch_mm: float, step_mm: float) -> Measures:
    """Measure rows of readings and their normals (N, 3) against the exact surface."""
    spots = np.concatenate(rows)
    foot, exact, distance = truth.closest(spots)
    angle = np.degrees(np.arccos(np.clip(np.einsum("nk,nk->n", normals, exact), -1, 1)))
    cuts = np.cumsum([0, *(len(r) for r in rows)])
    spacing = [
        arc(foot[a : b - 1], foot[a + 1 : b], exact[a : b - 1], exact[a + 1 : b]) for a, b in pairwise(cuts.tolist())
    ]
    every = np.concatenate(spacing)
    path, path_normal, strand = _path(rows, truth)
    swept, radius = _coverage(path, path_normal, truth, pitch_mm / 2)
    apart = _row_distances(path, path_normal, strand, pitch_mm)
    return Measures(
        swept,
        radius,
        float(np.abs(every - step_mm).max()),
        float((np.abs(apart - pitch_mm) <= 0.05 * pitch_mm).mean()),
        float(angle.mean()),
        float(angle.max()),
        len(spots) * pitch_mm * step_mm / truth.area_mm2,
        float(np.abs(distance).max()),
        float(every.sum()),
        len(rows),
    )


def _path(rows: list[Array], truth: Truth, fine_mm: float = 0.25) -> tuple[Array, Array, Array]:
    points, strand = [], []
    for k, row in enumerate(rows):
        n = np.maximum(np.ceil(np.linalg.norm(np.diff(row, axis=0), axis=1) / fine_mm).astype(int), 1)
        segment = np.repeat(np.arange(len(n)), n)
        t = (np.arange(len(segment)) - np.repeat(np.cumsum(n) - n, n)) / n[segment]
        points.append(np.concatenate([row[segment] + t[:, None] * np.diff(row, axis=0)[segment], row[-1:]]))
        strand.append(np.full(len(points[-1]), k))
    foot, normal, _ = truth.closest(np.concatenate(points))
    return foot, normal, np.concatenate(strand)


def _coverage(path: Array, normals: Array, truth: Truth, reach_mm: float) -> tuple[float, float]:
    _, near = KDTree(path).query(truth.samples)
    near = np.asarray(near)
    distance = arc(truth.samples, path[near], truth.sample_normals, normals[near])
    # The path is sampled every 0.25 mm: the true foot may be up to 0.125 mm along it.
    distance = np.sqrt(np.maximum(distance**2 - _along(path, near, truth.samples) ** 2, 0.0))
    return float((distance <= reach_mm * 1.0005).mean()), float(distance.max())


def _along(path: Array, near: Array, samples: Array, most_mm: float = 0.125) -> Array:
    before, after = path[np.maximum(near - 1, 0)], path[np.minimum(near + 1, len(path) - 1)]
    here = path[near]
    tangent = after - before
    ends = (np.linalg.norm(after - here, axis=1) > 1.0) | (np.linalg.norm(before - here, axis=1) > 1.0)
    ends |= (near == 0) | (near == len(path) - 1)
    length = np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    along = np.einsum("nk,nk->n", samples - here, tangent / length)
    return np.where(ends, 0.0, np.clip(along, -most_mm, most_mm))


def _row_distances(path: Array, normals: Array, strand: Array, pitch_mm: float) -> Array:
    tangent = np.gradient(path, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    ask = np.linspace(0, len(path) - 1, min(len(path), 5000)).astype(int)
    tree = KDTree(path)
    found, index = tree.query(path[ask], k=min(260, len(path)), distance_upper_bound=2 * pitch_mm)
    valid = np.isfinite(found)
    index = np.where(valid, index, 0)
    offset = path[index] - path[ask][:, None]
    across = np.cross(normals[ask], tangent[ask])
    lateral = np.einsum("nkj,nj->nk", offset, across)
    other = valid & (strand[index] != strand[ask][:, None])
    other &= np.abs(lateral) > np.cos(np.radians(30)) * np.linalg.norm(offset, axis=2)
    d = arc(path[ask][:, None], path[index], normals[ask][:, None], normals[index])
    both = np.concatenate([np.where(other & side, d, np.inf).min(axis=1) for side in (lateral > 0, lateral < 0)])
    return np.asarray(both[np.isfinite(both)])
