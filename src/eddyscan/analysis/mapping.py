"""Readings to values on the surface: every vertex asks its nearest readings, or stays uncovered."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.mesh import SurfaceMesh

NEAREST = 4


def map_to_surface(
    mesh: SurfaceMesh,
    foot_mm: Array,
    values: Mapping[str, NDArray[Any]],
    *,
    reach_mm: float,
    speaks: BoolArray | None = None,
) -> CScan:
    """Map readings on the mesh's vertices.

    A vertex takes the mean of its `NEAREST` readings, weighted by inverse squared
    distance; across gaps wider than `reach_mm` nothing is invented.

    Parameters
    ----------
    mesh : SurfaceMesh
    foot_mm : (M, 3) spots the readings look at [mm, part]
    values : dict of name -> (M,)
        Channels; complex ones give their magnitude.
    reach_mm : float [mm]
        A vertex further than this from every reading is not covered.
    speaks : (M,) bool, optional
        Readings that may cover a vertex (near enough to the metal to see a flaw).
    """
    shape = (len(mesh.vertices), min(NEAREST, len(foot_mm)))
    answer = KDTree(foot_mm).query(mesh.vertices, k=shape[1])
    distance, near = np.reshape(answer[0], shape), np.reshape(answer[1], shape).astype(np.int64)
    weight = 1.0 / np.maximum(distance, 1e-6) ** 2 * (distance <= max(reach_mm, 1e-6) * 1.5)
    heard = np.ones(len(foot_mm), dtype=bool) if speaks is None else speaks
    covered = np.asarray((distance[:, 0] <= reach_mm) & heard[near[:, 0]])
    channels = {name: _weighted(np.asarray(value), near, weight, covered) for name, value in values.items()}
    return CScan(mesh, covered, channels)


def _weighted(value: NDArray[Any], near: IntArray, weight: Array, covered: BoolArray) -> Array:
    """Return the weighted mean per vertex; NaN where no reading speaks."""
    picked = np.abs(value)[near] if np.iscomplexobj(value) else np.asarray(value, dtype=np.float64)[near]
    weight = np.where(np.isfinite(picked), weight, 0.0)
    total = weight.sum(axis=1)
    mean = np.divide(
        (weight * np.nan_to_num(picked)).sum(axis=1), total, out=np.full(len(total), np.nan), where=total > 0
    )
    return np.asarray(np.where(covered, mean, np.nan))
