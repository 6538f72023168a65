"""Readings against the footprint of a crack: many weak neighbours speak louder than one."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.spatial import KDTree

from eddyscan.analysis.background import robust_sigma
from eddyscan.core.frames import Array

REACH_IN_WIDTHS = 2.0


def blob_score(channel: Array, foot_mm: Array, *, width_mm: float) -> Array:
    """Return the channel matched with a round footprint, in robust standard deviations (M,).

    Parameters
    ----------
    channel : (M,) signed residual; NaN is left out
    foot_mm : (M, 3) [mm]
    width_mm : float [mm] standard deviation of the footprint
    """
    used = np.flatnonzero(np.isfinite(channel))
    weights = _weights(foot_mm[used], width_mm)
    power = np.sqrt(np.asarray(weights.multiply(weights).sum(axis=1)).ravel())
    matched = (weights @ channel[used]) / power
    score = np.full(len(channel), np.nan)
    score[used] = np.abs(matched) / max(robust_sigma(matched), 1e-300)
    return score


def _weights(foot_mm: Array, width_mm: float) -> csr_matrix:
    pairs = KDTree(foot_mm).query_pairs(REACH_IN_WIDTHS * width_mm, output_type="ndarray")
    distance = np.linalg.norm(foot_mm[pairs[:, 0]] - foot_mm[pairs[:, 1]], axis=1)
    value = np.exp(-0.5 * (distance / width_mm) ** 2)
    n = len(foot_mm)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1], np.arange(n)])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0], np.arange(n)])
    return csr_matrix(coo_matrix((np.concatenate([value, value, np.ones(n)]), (rows, columns)), shape=(n, n)))
