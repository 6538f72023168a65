"""Nearest neighbours with plain array types."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eddyscan.core.frames import Array


def nearest(among: Array, points: Array) -> NDArray[np.int64]:
    """Return the index in `among` (M, d) nearest to every point (N, d)."""
    return np.asarray(KDTree(among).query(points)[1], dtype=np.int64)


def nearest_with_distance(among: Array, points: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return distance (N,) and index (N,) of the nearest of `among` to every point."""
    distance, index = KDTree(among).query(points)
    return np.asarray(distance, dtype=np.float64), np.asarray(index, dtype=np.int64)


def neighbours(tree: KDTree, points: Array, count: int, reach: float) -> tuple[Array, NDArray[np.int64]]:
    """Return distance and index (N, count) within `reach`; distance is infinite where there are fewer."""
    distance, index = tree.query(points, k=count, distance_upper_bound=reach)
    return np.asarray(distance, dtype=np.float64), np.asarray(index, dtype=np.int64)
