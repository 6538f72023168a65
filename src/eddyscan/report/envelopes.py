"""Long lines drawn short: what a screen can show of them, with every extreme kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 3000


def envelope(x: Array, values: Array, bins: int = 800) -> tuple[Array, Array, Array]:
    """Return x, least and largest value (K,) of up to `bins` stretches of a line; NaN values are left out."""
    known = np.isfinite(values) & np.isfinite(x)
    x, values = x[known], values[known]
    starts = np.unique(np.linspace(0, len(x), bins, endpoint=False).astype(int)) if len(x) else np.zeros(0, dtype=int)
    if starts.size == 0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    return x[starts], np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


def line(axes: Axes, x: Array, values: Array, *, colour: str, width: float = 1.0) -> None:
    """Draw a line; one of many points as the band between its least and largest values."""
    if len(values) <= MOST_POINTS:
        axes.plot(x, values, color=colour, lw=width)
        return
    place, low, high = envelope(x, values)
    axes.fill_between(place, low, high, color=colour, lw=0.5)


def sparse(count: int, most: int = MOST_POINTS) -> slice:
    """Return the slice that keeps at most `most` of `count` entries, evenly."""
    return slice(None, None, max(1, -(-count // most)))
