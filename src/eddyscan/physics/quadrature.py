"""Composite Gauss-Legendre rules."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from eddyscan.core.frames import Array


@lru_cache(maxsize=64)
def _legendre(order: int) -> tuple[Array, Array]:
    x, w = np.polynomial.legendre.leggauss(order)
    return np.asarray(x), np.asarray(w)


def gauss_panels(edges: Array, order: int) -> tuple[Array, Array]:
    """Return nodes and weights (P*order,) of a Gauss-Legendre rule on the panels between `edges` (P+1,)."""
    x, w = _legendre(order)
    half = 0.5 * np.diff(edges)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1])[:, None]
    return (middle + half * x).ravel(), (half * w).ravel()
