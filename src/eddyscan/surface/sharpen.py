"""Sharpen poses and outline together with what the views show of the part's border.

Point-to-plane registration leaves a smooth part free to slide along itself;
its border does not. Every view places the border twice: by the side wall where it looks
at one, by the edge of the top surface elsewhere (`edges`). Offsets between
views correct their poses, the mean of all views is the outline.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eddyscan.core.frames import Array, apply, from_rotation_vector, invert
from eddyscan.surface.axes import align
from eddyscan.surface.edges import Height, measure_edges
from eddyscan.surface.outline import Outline, even_spacing, outward, wall_offsets
from eddyscan.surface.part_frame import PartFrame
from eddyscan.surface.refine import LEVER_MM
from eddyscan.surface.sides import straightened
from eddyscan.surface.view import View

LOOSE_MM = 0.4  # standard uncertainty sideways above which the first look must reach far
EDGE_NOISE_MM = 0.25
EDGE_CORRELATION_MM = 10.0
FACED_COSINE = 0.3  # a wall seen this squarely is used itself; the edge above it is biased outwards
CLEAR_SHARE = 0.3


@dataclass(frozen=True)
class Sharpened:
    """Views with corrected poses, the part's frame, and the normal matrix that holds all evidence."""

    views: tuple[View, ...]
    part: PartFrame
    information: Array | None
    border_share: float


@dataclass(frozen=True)
class Look:
    """One pass: how far to look, over which length to pool, how far off an offset may be believed [mm]."""

    reach_mm: float
    pool_mm: float
    trust_mm: float


FAR_LOOK = Look(16.0, 8.0, 1e9)
LOOKS = (Look(4.0, 5.0, 1e9), Look(4.0, 12.0, 2.0), Look(4.0, 12.0, 2.0))


@dataclass(frozen=True)
class _Border:
    """Seen border positions: offsets (K, S) [mm] from a contour (S, 2) along its normals, box frame."""

    offset: Array
    contour: Array
    normal: Array
    rim: Array  # (S, 3) the border in space


def sharpen(
    views: Sequence[View],
    part: PartFrame,
    height: Height,
    *,
    information: Array | None,
    centre: Array,
    reference: int,
    looks: tuple[Look, ...] | None = None,
) -> Sharpened:
    """Correct poses (unless `information` is None: given poses stay) and place the outline.

    Parameters
    ----------
    views : posed
    part : rough frame and outline
    height : (N, 2) -> (N,) [mm, part frame], the top surface, extrapolated beyond its edge
    information : (6K, 6K) normal matrix of the point-to-plane registration about `centre` [world]
    reference : index of the view that stays
    looks : passes; `(FAR_LOOK,)` when views may stand many millimetres off
    """
    looks = LOOKS if looks is None else looks
    current = list(views)
    outline, seen = part.outline, 0.0
    total = information
    for look in looks:
        border = _measure(current, part, outline, height, look)
        seen = float(np.isfinite(border.offset).any(axis=0).mean())
        if seen < CLEAR_SHARE:
            break
        if information is not None:
            twists, shifted, total = _pose_correction(border, part, information, centre, reference)
            current = [_moved(v, twists[k], centre) for k, v in enumerate(current)]
            border = replace(border, offset=shifted)
        outline = _placed(border, look.trust_mm)
    points = np.concatenate([v.points_in(part.T_part_world, *part.box(0.0))[0] for v in current])
    axes = align(outline, points)
    frame = PartFrame(
        axes.T_part_box @ part.T_part_world,
        np.array([*axes.size_mm, part.size_mm[2]]),
        outline.moved(axes.T_part_box),
        axes.warnings,
    )
    return Sharpened(tuple(current), frame, total, seen)


def is_loose(information: Array | None, reference: int) -> bool:
    """Say whether point-to-plane registration left a view free to slide, so that a far look must come first."""
    return information is not None and bool(sideways_uncertainty(information, reference).max(initial=0.0) > LOOSE_MM)


def sideways_uncertainty(information: Array, reference: int) -> Array:
    """Return the largest standard uncertainty in x, y [mm] of every view but the reference (K-1,)."""
    free = np.ones(len(information), dtype=bool)
    free[6 * reference : 6 * reference + 6] = False
    covariance = np.linalg.inv(information[np.ix_(free, free)] + 1e-6 * np.eye(int(free.sum())))
    blocks = [covariance[6 * k + 3 : 6 * k + 5, 6 * k + 3 : 6 * k + 5] for k in range(len(covariance) // 6)]
    return np.array([np.sqrt(max(float(np.linalg.eigvalsh(b)[-1]), 0.0)) for b in blocks])


def _measure(views: Sequence[View], part: PartFrame, outline: Outline, height: Height, look: Look) -> _Border:
    contour = even_spacing(outline.polygon, 1.0)
    normal = outward(contour)
    edges = measure_edges(
        views, part.T_part_world, contour, normal, height, pool_mm=look.pool_mm, reach_mm=look.reach_mm
    )
    rim = np.concatenate([contour, height(contour)[:, None]], axis=1)
    offset = edges.offset_mm.copy()
    low, high = part.box(6.0)
    for k, view in enumerate(views):
        walls, normals = view.surfels_in(part.T_part_world, low + np.array([0, 0, 1.0]), high)
        shift, known = wall_offsets(contour, normal, walls, normals)
        offset[k] = np.where(_faced(view, part, rim, normal), np.nan, offset[k])
        offset[k] = np.where(known, shift, offset[k])
    return _Border(offset, contour, normal, rim)


def _faced(view: View, part: PartFrame, rim: Array, normal: Array) -> Array:
    eye = (part.T_part_world @ view.T_world_camera)[:3, 3]
    sight = eye - rim
    cosine = (sight[:, :2] * normal).sum(axis=1) / np.linalg.norm(sight, axis=1)
    return np.asarray(cosine > FACED_COSINE)


def _pose_correction(
    border: _Border, part: PartFrame, information: Array, centre: Array, reference: int
) -> tuple[Array, Array, Array]:
    """Return twists (K, 6), the offsets after them (K, S) and the normal matrix of all evidence."""
    views, _ = border.offset.shape
    T_world_part = invert(part.T_part_world)
    normal = np.concatenate([border.normal, np.zeros((len(border.normal), 1))], axis=1) @ T_world_part[:3, :3].T
    lever = apply(T_world_part, border.rim) - centre
    rows = np.concatenate([np.cross(lever, normal) / LEVER_MM, normal], axis=1)
    offset, twists = border.offset.copy(), np.zeros((views, 6))
    H = information
    free = np.ones(6 * views, dtype=bool)
    free[6 * reference : 6 * reference + 6] = False
    total = H
    for _ in range(6):
        weight = _weights(offset)
        E, g = _edge_system(offset, weight, rows)
        total = H + E
        slope = g - H @ twists.ravel()
        step = np.zeros(6 * views)
        damping = 1e-9 * float(np.trace(total)) * np.eye(int(free.sum()))
        step[free] = np.linalg.solve(total[np.ix_(free, free)] + damping, slope[free])
        twists += step.reshape(views, 6)
        offset = offset + step.reshape(views, 6) @ rows.T
    return twists, offset, total


def _weights(offset: Array) -> Array:
    """Tukey weights (K, S) about the views' common border."""
    seen = np.isfinite(offset)
    common = _median(offset)
    residual = np.where(seen, offset - common, 0.0)
    pairs = seen & (seen.sum(axis=0) > 1)
    scale = max(EDGE_NOISE_MM / 2, 1.4826 * float(np.median(np.abs(residual[pairs])))) if pairs.any() else 1.0
    tukey = np.clip(1 - (residual / (4.685 * scale)) ** 2, 0, None) ** 2
    return np.asarray(np.where(seen, tukey / EDGE_NOISE_MM**2 / EDGE_CORRELATION_MM, 0.0))


def _median(offset: Array) -> Array:
    """Return the median over views (S,), 0 where none saw the border."""
    seen = np.isfinite(offset).any(axis=0)
    common = np.zeros(offset.shape[1])
    common[seen] = np.nanmedian(offset[:, seen], axis=0)
    return common


def _edge_system(offset: Array, weight: Array, rows: Array) -> tuple[Array, Array]:
    """Return normal matrix and right side of sum w (offset + row.twist - common)^2, the common border eliminated."""
    views = len(offset)
    value = np.where(weight > 0, offset, 0.0)
    total = weight.sum(axis=0)
    share = np.divide(weight, total, out=np.zeros_like(weight), where=total > 0)
    mean = (share * value).sum(axis=0)
    H, g = np.zeros((6 * views, 6 * views)), np.zeros(6 * views)
    for k in range(views):
        at = slice(6 * k, 6 * k + 6)
        g[at] = -rows.T @ (weight[k] * (value[k] - mean))
        for m in range(views):
            factor = weight[k] * ((k == m) - share[m])
            H[at, 6 * m : 6 * m + 6] = (rows * factor[:, None]).T @ rows
    return H, g


def _moved(view: View, twist: Array, centre: Array) -> View:
    small = from_rotation_vector(twist[:3] / LEVER_MM, np.zeros(3))
    small[:3, 3] = centre - small[:3, :3] @ centre + twist[3:]
    return replace(view, T_world_camera=small @ view.T_world_camera)


def _placed(border: _Border, trust_mm: float) -> Outline:
    trust = np.clip(1 - (np.nan_to_num(border.offset) / trust_mm) ** 2, 0.05, None)
    weight = _weights(border.offset) * trust
    total = weight.sum(axis=0)
    known = total > 0
    value = np.where(weight > 0, border.offset, 0.0)
    mean = np.divide((weight * value).sum(axis=0), total, out=np.zeros_like(total), where=known)
    index = np.arange(len(mean))
    mean = np.interp(index, index[known], mean[known], period=len(mean))
    polygon, directions, lengths = straightened(border.contour + border.normal * mean[:, None], known)
    return Outline(polygon, float(known.mean()), directions, lengths)
