"""All views at once: robust point-to-plane between every pair, one normal system.

A sampled surfel of view i is looked up in view j by projecting it into j's
image (projective association: no search tree), and its distance to j's local
plane is one residual. Moving view i by a small twist d_i = (w, t) about the
centre changes it by a'(d_i - d_j) with a = (x * n, n) [x: lever / L], so all pairs
fill one 6K x 6K system (multi-view registration after Pulli, 3DIM 1999, with
the point-to-plane residual of Chen and Medioni, IVC 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array, apply, from_rotation_vector, invert, rotate
from eddyscan.surface.surfels import SurfelImage

LEVER_MM = 100.0  # rotations are scaled by this length, so all unknowns are mm
TABLE_WEIGHT = 0.3
INFLATION = 60.0  # neighbouring pixels share their noise: this many count as one
NOISE_MEDIAN = 2.77  # median of |n_a - n_b|^2 over the variance of one tangential component
SEARCH_INFORMATION = (1e-4, 1e-4, 1.0, 1.0, 1.0, 1e-4)  # 1/mm^2: the search places x, y and yaw within a millimetre
SCALE_FLOOR_MM = 0.05  # quantised depth has zero median deviation: a robust scale needs a floor
NORMAL_COSINE = 0.8
OBJECT_SAMPLES = 3500
TABLE_SAMPLES = 1000
GATES_MM = (6.0, 4.0, 3.0, 2.0, 1.5, 1.2, 1.0, 1.0, 1.0, 1.0)
QUALITY_GATE_MM = 3.0
CONVERGED_MM = 0.003


@dataclass(frozen=True)
class Samples:
    """Surfels of one view that ask the other views where the surface is.

    Attributes
    ----------
    points, normals : (N, 3) [mm, camera]
    weight : (N,)
    """

    points: Array
    normals: Array
    weight: Array


@dataclass(frozen=True)
class JointResult:
    """Poses and the normal system they came from.

    Attributes
    ----------
    poses : T_table_camera of every view
    information : (6K, 6K) normal matrix [1/mm^2], twists (lever-scaled rotation, translation) about `centre`
    centre : (3,) [mm, table]
    pair_rmse_mm, pair_share : (K, K) residual and matched share of samples per pair (row asks column)
    scale_mm : robust residual scale
    converged : bool
    """

    poses: tuple[Array, ...]
    information: Array
    centre: Array
    pair_rmse_mm: Array
    pair_share: Array
    scale_mm: float
    converged: bool


def draw_samples(image: SurfelImage, T_table_camera: Array, rng: np.random.Generator) -> Samples:
    """Draw surfels, most of them on objects, with steep ones preferred: they alone see x, y and yaw."""
    valid = image.valid
    points, normals = image.points[valid].astype(float), image.normals[valid].astype(float)
    height = apply(T_table_camera, points)[:, 2]
    flatness = rotate(T_table_camera, normals)[:, 2]
    chance = np.where(height > 3.0, 1.0 + 6.0 * (1 - flatness), 0.0)
    tall = _draw(chance, OBJECT_SAMPLES, rng)
    table = _draw((np.abs(height) < 3.0).astype(float), TABLE_SAMPLES, rng)
    pick = np.concatenate([tall, table])
    weight = np.concatenate([np.ones(len(tall)), np.full(len(table), TABLE_WEIGHT)])
    return Samples(points[pick], normals[pick], weight)


def _draw(chance: Array, limit: int, rng: np.random.Generator) -> NDArray[np.int64]:
    possible = np.nonzero(chance > 0)[0]
    if len(possible) <= limit:
        return possible
    key = rng.random(len(possible)) ** (1.0 / chance[possible])
    return np.asarray(possible[np.argpartition(key, -limit)[-limit:]])


@dataclass(frozen=True)
class _Matches:
    """Residuals of one ordered pair.

    Attributes
    ----------
    distance : (M,) [mm]
    row : (M, 6)
    weight : (M,)
    lever : (M, 3) place relative to the centre / LEVER_MM
    noise : (M,) squared difference of the two views' normals
    """

    distance: Array
    row: Array
    weight: Array
    lever: Array
    noise: Array


def match(source: Samples, target: SurfelImage, T_a: Array, T_b: Array, centre: Array, gate_mm: float) -> _Matches:
    """Look samples (pose T_a) up in the target image (pose T_b); both poses are table <- camera."""
    T_target_source = invert(T_b) @ T_a
    p, n = apply(T_target_source, source.points), rotate(T_target_source, source.normals)
    camera = target.camera
    z = np.where(p[:, 2] > 1, p[:, 2], np.inf)
    j = np.rint(camera.fx * p[:, 0] / z + camera.cx).astype(np.int64)
    i = np.rint(camera.fy * p[:, 1] / z + camera.cy).astype(np.int64)
    ok = (i >= 0) & (j >= 0) & (i < camera.height) & (j < camera.width) & (p[:, 2] > 1)
    k = np.nonzero(ok)[0]
    q, m = target.points[i[k], j[k]].astype(float), target.normals[i[k], j[k]].astype(float)
    distance = ((p[k] - q) * m).sum(axis=1)
    good = np.isfinite(distance)
    good[good] = (np.abs(distance[good]) < gate_mm) & ((n[k][good] * m[good]).sum(axis=1) > NORMAL_COSINE)
    k, distance = k[good], distance[good]
    normal = rotate(T_b, m[good])
    lever = (apply(T_a, source.points[k]) - centre) / LEVER_MM
    row = np.concatenate([np.cross(lever, normal), normal], axis=1)
    noise = ((rotate(T_a, source.normals[k]) - normal) ** 2).sum(axis=1)
    return _Matches(distance, row, source.weight[k], lever, noise)


def joint_refinement(
    images: Sequence[SurfelImage], poses: Sequence[Array], *, reference: int, seed: int = 0
) -> JointResult:
    """Refine all poses together, the reference view's held fixed.

    Parameters
    ----------
    images : one per view
    poses : T_table_camera of each view, right within about 6 mm
    reference : int
        The view that does not move: it carries the frame.
    """
    rng = np.random.default_rng(seed)
    samples = [draw_samples(image, T, rng) for image, T in zip(images, poses, strict=True)]
    current = [T.copy() for T in poses]
    centre = np.median(np.concatenate([apply(T, s.points) for s, T in zip(samples, current, strict=True)]), axis=0)
    pairs = [(a, b) for a in range(len(images)) for b in range(len(images)) if a != b]
    scale, converged, moved = 0.5, False, np.zeros(6 * len(images))
    for step, gate in enumerate(GATES_MM):
        found = {(a, b): match(samples[a], images[b], current[a], current[b], centre, gate) for a, b in pairs}
        distance = np.concatenate([m.distance for m in found.values()])
        scale = max(SCALE_FLOOR_MM, 1.4826 * float(np.median(np.abs(distance)))) if distance.size else gate
        information, gradient = _normal_system(found, len(images), scale)
        twist = _solve(information, gradient, moved, reference)
        moved += twist
        for k in range(len(images)):
            current[k] = _moved(current[k], twist[6 * k : 6 * k + 6], centre)
        converged = bool(np.abs(twist).max() < CONVERGED_MM)
        if converged and step > 6:
            break
    rmse, share = _pair_table(found, samples, len(images))
    return JointResult(tuple(current), information, centre, rmse, share, scale, converged)


def pair_quality(images: Sequence[SurfelImage], poses: Sequence[Array], *, seed: int = 0) -> JointResult:
    """Measure how well views agree at given poses, without moving any."""
    rng = np.random.default_rng(seed)
    samples = [draw_samples(image, T, rng) for image, T in zip(images, poses, strict=True)]
    centre = np.median(np.concatenate([apply(T, s.points) for s, T in zip(samples, poses, strict=True)]), axis=0)
    pairs = [(a, b) for a in range(len(images)) for b in range(len(images)) if a != b]
    found = {(a, b): match(samples[a], images[b], poses[a], poses[b], centre, QUALITY_GATE_MM) for a, b in pairs}
    information, _ = _normal_system(found, len(images), QUALITY_GATE_MM / 3)
    rmse, share = _pair_table(found, samples, len(images))
    return JointResult(tuple(poses), information, centre, rmse, share, QUALITY_GATE_MM / 3, True)


def _normal_system(found: dict[tuple[int, int], _Matches], views: int, scale: float) -> tuple[Array, Array]:
    """Return the information matrix [1/mm^2] and gradient; neighbours share noise, so counts are deflated."""
    H, g = np.zeros((6 * views, 6 * views)), np.zeros(6 * views)
    noise = np.concatenate([m.noise for m in found.values()])
    variance = float(np.median(noise)) / NOISE_MEDIAN if noise.size else 0.0
    for (a, b), m in found.items():
        if not m.distance.size:
            continue
        tukey = np.clip(1 - (m.distance / (4.685 * scale)) ** 2, 0, None) ** 2
        w = m.weight * tukey / scale**2 / INFLATION
        A = _without_noise((m.row * w[:, None]).T @ m.row, w, m.lever, variance)
        v = m.row.T @ (w * m.distance)
        sa, sb = slice(6 * a, 6 * a + 6), slice(6 * b, 6 * b + 6)
        H[sa, sa] += A
        H[sb, sb] += A
        H[sa, sb] -= A
        H[sb, sa] -= A
        g[sa] -= v
        g[sb] += v
    return H, g


def _without_noise(A: Array, weight: Array, lever: Array, variance: float) -> Array:
    """Take out what the noise of the normals alone adds to a normal matrix.

    A flat surface with noisy normals looks as if it held the part sideways.
    With tangential noise of the given variance per direction the expected
    excess is variance * sum w M (1 - n n') M', M = ([x]; 1), row = M n.
    """
    first = (weight[:, None] * lever).sum(axis=0)
    second = (weight[:, None] * lever).T @ lever
    cross = np.array([[0.0, -first[2], first[1]], [first[2], 0.0, -first[0]], [-first[1], first[0], 0.0]])
    full = np.block([[np.trace(second) * np.eye(3) - second, cross], [cross.T, weight.sum() * np.eye(3)]])
    values, vectors = np.linalg.eigh(A - variance * (full - A))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)


def _solve(H: Array, g: Array, moved: Array, reference: int) -> Array:
    """Solve for all twists but the reference's; where the surfaces say nothing the search's pose holds."""
    free = np.ones(len(g), dtype=bool)
    free[6 * reference : 6 * reference + 6] = False
    prior = np.tile(SEARCH_INFORMATION, len(g) // 6)[free]
    twist = np.zeros(len(g))
    right = g[free] - prior * moved[free]
    twist[free] = np.linalg.solve(H[np.ix_(free, free)] + np.diag(prior), right)
    return twist


def _moved(T: Array, twist: Array, centre: Array) -> Array:
    small = from_rotation_vector(twist[:3] / LEVER_MM, np.zeros(3))
    small[:3, 3] = centre - small[:3, :3] @ centre + twist[3:]
    return np.asarray(small @ T)


def _pair_table(found: dict[tuple[int, int], _Matches], samples: Sequence[Samples], views: int) -> tuple[Array, Array]:
    rmse, share = np.full((views, views), np.nan), np.zeros((views, views))
    for (a, b), m in found.items():
        if m.distance.size:
            rmse[a, b] = float(np.sqrt(np.mean(m.distance**2)))
            share[a, b] = m.distance.size / max(len(samples[a].points), 1)
    return rmse, share
