"""Mask what a stereo camera invents: flying pixels, fattened edges, specks.

All of it happens in the depth image, before a pixel becomes a point: after
deprojection a flying pixel looks like any other point.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array

JUMP_SHARE = 0.014  # an edge: neighbouring medians differ by this share of the distance (2 px of 143 px disparity)
SPECK_SHARE = 0.0042  # a flying pixel: differs from its 5 x 5 median by this share (0.6 px of disparity)
EDGE_BAND_PX = 3  # matching windows fatten edges by about this much on either side
SHADOW_MIN_PX = 60  # a hole this large is an occlusion shadow; its rim is as unsafe as an edge
SHADOW_JUMP_SHARE = 0.03

Depth32 = NDArray[np.float32]


def clean(depth_mm: Array, *, near_mm: float, far_mm: float) -> Depth32:
    """Return the depth image with unsafe pixels set to NaN.

    Parameters
    ----------
    depth_mm : (H, W) float64 [mm], NaN = no return
    near_mm, far_mm : float [mm]
        Range gate along the optical axis.

    Returns
    -------
    (H, W) float32 [mm]
    """
    import cv2

    depth = np.nan_to_num(depth_mm, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
    depth[(depth < near_mm) | (depth > far_mm)] = 0
    median = cv2.medianBlur(depth, 5)
    safe = (depth > 0) & (median > 0)
    safe &= np.abs(depth - median) < SPECK_SHARE * median
    safe &= ~_edge_band(cv2, median)
    safe &= ~_shadow_band(cv2, depth, median)
    return np.where(safe, depth, np.float32(np.nan)).astype(np.float32)


def _spread(cv2: Any, image: Depth32, size: int) -> Depth32:
    """Return max - min of the valid (> 0) pixels in a window."""
    box = np.ones((size, size), np.uint8)
    high = cv2.dilate(image, box)
    low = cv2.erode(np.where(image > 0, image, np.float32(1e9)), box)
    return np.asarray(np.maximum(high - low, 0), dtype=np.float32)


def _edge_band(cv2: Any, median: Depth32) -> NDArray[np.bool_]:
    edge = (_spread(cv2, median, 3) > JUMP_SHARE * median) & (median > 0)
    band = 2 * EDGE_BAND_PX + 1
    return np.asarray(cv2.dilate(edge.astype(np.uint8), np.ones((band, band), np.uint8)) > 0)


def _shadow_band(cv2: Any, depth: Depth32, median: Depth32) -> NDArray[np.bool_]:
    """Return the rims of large holes, and of smaller ones with different depths on their sides."""
    hole = (depth <= 0).astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(hole, connectivity=4)
    shadow = stats[:, cv2.CC_STAT_AREA] >= SHADOW_MIN_PX
    shadow[0] = False
    band = np.ones((2 * EDGE_BAND_PX + 1, 2 * EDGE_BAND_PX + 1), np.uint8)
    rim = cv2.dilate(shadow[label].astype(np.uint8), band) > 0
    near_hole = cv2.dilate(hole, band) > 0
    split = _spread(cv2, median, 2 * EDGE_BAND_PX + 1) > SHADOW_JUMP_SHARE * np.maximum(median, 1)
    return np.asarray(rim | (near_hole & split))
