"""Where each view sees the part end: the only thing that fixes a smooth part sideways.

A stereo camera fattens the foreground at a depth jump, but in patches: within
the 3 px band outside the true edge less than half of the pixels show the
foreground, within the band inside more than half do. The place where the share
of pixels that lie on the (extrapolated) top surface falls through one half is
therefore the edge itself, at a jump and at a crease alike, with no masking.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from eddyscan.core.frames import Array, apply, invert
from eddyscan.surface.view import View

REACH_MM = 4.0
STEP_MM = 0.2
NEARER_MM = 2.5  # a fattened pixel carries the depth of a neighbour up to 3 px away
FARTHER_MM = 0.6  # a wall's pixel soon lies deeper than the extrapolated top
INSIDE_SHARE, OUTSIDE_SHARE = 0.75, 0.35

Height = Callable[[Array], Array]


@dataclass(frozen=True)
class EdgeOffsets:
    """Seen minus expected edge position, per view and contour sample.

    Attributes
    ----------
    offset_mm : (K, S) along the outward normal, NaN where the view shows no clear edge
    contour, normal : (S, 2) [mm, box frame]
    spacing_mm : float
    """

    offset_mm: Array
    contour: Array
    normal: Array
    spacing_mm: float


def measure_edges(
    views: Sequence[View],
    T_box_world: Array,
    contour: Array,
    normal: Array,
    height: Height,
    *,
    pool_mm: float,
    reach_mm: float = REACH_MM,
) -> EdgeOffsets:
    """Find the edge along every contour sample in every view.

    Parameters
    ----------
    views : posed
    T_box_world : (4, 4) to the frame of `contour`
    contour, normal : (S, 2) evenly spaced closed contour [mm] and its outward unit normals
    height : function (N, 2) -> (N,) [mm], the top surface, extrapolated a little beyond its edge
    pool_mm : float
        Length along the contour over which pixels are pooled. Fattening comes in patches: over too short a
        length a patch looks like the edge.
    reach_mm : float
        Largest offset that is looked for.
    """
    across = np.arange(-reach_mm, reach_mm + STEP_MM / 2, STEP_MM)
    xy = contour[:, None] + across[None, :, None] * normal[:, None]
    z = height(xy.reshape(-1, 2))
    points = np.concatenate([xy.reshape(-1, 2), z[:, None]], axis=1)
    spacing = float(np.linalg.norm(np.diff(contour, axis=0), axis=1).mean())
    sigma = pool_mm / spacing
    offsets = []
    for view in views:
        on_top, looked = (layer.reshape(xy.shape[:2]) for layer in _on_top(view, T_box_world, points))
        share = gaussian_filter1d(on_top, sigma, axis=0, mode="wrap")
        known = gaussian_filter1d(looked, sigma, axis=0, mode="wrap")
        offsets.append(_step_position(share, known, across))
    return EdgeOffsets(np.stack(offsets), contour, normal, spacing)


def _on_top(view: View, T_box_world: Array, points: Array) -> tuple[Array, Array]:
    """Return 1 where the view's raw pixel lies on the surface point, and 1 where the point is in the picture."""
    p = apply(invert(T_box_world @ view.T_world_camera), points)
    camera = view.camera
    j = np.rint(camera.fx * p[:, 0] / p[:, 2] + camera.cx).astype(np.int64)
    i = np.rint(camera.fy * p[:, 1] / p[:, 2] + camera.cy).astype(np.int64)
    inside = (i >= 0) & (j >= 0) & (i < camera.height) & (j < camera.width)
    seen = view.raw[np.where(inside, i, 0), np.where(inside, j, 0)].astype(np.float64)
    behind = seen - p[:, 2]
    hit = inside & (behind > -NEARER_MM) & (behind < FARTHER_MM)
    return hit.astype(float), inside.astype(float)


def _step_position(share: Array, known: Array, across: Array) -> Array:
    """Return where the share falls through one half (S,), NaN where there is no clear step."""
    gain = np.cumsum(share - 0.5 * known, axis=1)
    best = np.argmax(gain, axis=1)
    rows = np.arange(len(share))
    left, mid, right = (gain[rows, np.clip(best + k, 0, len(across) - 1)] for k in (-1, 0, 1))
    curve = left - 2 * mid + right
    shift = np.where(np.abs(curve) > 1e-9, 0.5 * (left - right) / np.where(np.abs(curve) > 1e-9, curve, 1), 0.0)
    position = across[best] + (0.5 + np.clip(shift, -0.5, 0.5)) * STEP_MM
    inner = np.cumsum(share, axis=1)[rows, best] / np.maximum(best + 1, 1)
    outer = (share.sum(axis=1) - np.cumsum(share, axis=1)[rows, best]) / np.maximum(len(across) - best - 1, 1)
    clear = (inner > INSIDE_SHARE) & (outer < OUTSIDE_SHARE) & (known.min(axis=1) > 0.9)
    clear &= (best > 3) & (best < len(across) - 4)
    return np.where(clear, position, np.nan)
