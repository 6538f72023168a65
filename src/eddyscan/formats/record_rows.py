"""Rows of a path that came without row numbers."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array, IntArray

GAP_IN_STEPS = 5.0
TURN_COSINE = 0.5  # a change of heading by more than 60 degrees


def rows_along(positions_mm: Array) -> tuple[IntArray, IntArray]:
    """Cut a path into rows and number the points in each.

    Parameters
    ----------
    positions_mm : (N, K) [mm]
        In the order visited; NaN positions all fall into row 0.

    Returns
    -------
    row, point : (N,) int64
        A new row begins after a gap of more than 5 median steps and where the
        heading turns by more than 60 degrees; a step of no length turns nothing.
    """
    n = len(positions_mm)
    if n < 3 or not np.isfinite(positions_mm).all():
        return np.zeros(n, dtype=np.int64), np.arange(n)
    steps = np.diff(positions_mm, axis=0)
    length = np.linalg.norm(steps, axis=1)
    moving = np.flatnonzero(length > 1e-9)
    begins = np.zeros(n, dtype=bool)
    if moving.size:
        begins[moving[length[moving] > GAP_IN_STEPS * np.median(length[moving])] + 1] = True
        heading = steps[moving] / length[moving, None]
        turned = (heading[1:] * heading[:-1]).sum(axis=1) < TURN_COSINE
        begins[moving[1:][turned] + 1] = True
        begins[1:] &= ~begins[:-1]  # the step out of a turn or gap belongs to its row
    row = np.cumsum(begins)
    first = np.flatnonzero(np.concatenate([[True], np.diff(row) > 0]))
    return row.astype(np.int64), np.arange(n) - first[row]
