"""Crack responses for a whole campaign: tables over length and depth, built once, read by every case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.progress import Progress, silent
from eddyscan.physics import Coil, Conductor, Slot, SlotTable
from eddyscan.physics.tables import TableGrid, slot_table

LENGTH_RATIO, DEPTH_RATIO = 1.25, 1.5  # neighbouring nodes; the test holds the interpolation to 1 % of the peak
HEIGHTS = 8
ALONG, ACROSS = 33, 25


@dataclass(frozen=True)
class SlotLibrary:
    """Signals of slots of any length and depth between limits, for one coil, metal, frequency and opening.

    Attributes
    ----------
    lengths_mm, depths_mm : (L,), (D,) nodes, evenly spaced in the logarithm; with one
        depth per length (`depth_per_length`), D is 1 and its node is not used
    depth_per_length : float or None
    grid : TableGrid shared by all nodes, x counted from the slot's centre
    values : (L, D, X, Y, H) complex128 [ohm]
    """

    lengths_mm: Array
    depths_mm: Array
    grid: TableGrid
    values: ComplexArray
    depth_per_length: float | None = None

    def table(self, length_mm: float, depth_mm: float) -> SlotTable:
        """Return the table of one slot, interpolated in the logarithm of length and depth."""
        at_length = _between(np.log(self.lengths_mm), self.values, float(np.log(length_mm)))
        if self.depth_per_length is not None:
            return SlotTable(self.grid, at_length[0])
        return SlotTable(self.grid, _between(np.log(self.depths_mm), at_length, float(np.log(depth_mm))))


def build_library(
    coil: Coil,
    conductor: Conductor,
    frequency_hz: float,
    *,
    opening_mm: float,
    lengths_mm: tuple[float, float],
    depths_mm: tuple[float, float] | float,
    largest_lift_off_mm: float,
    progress: Progress = silent,
) -> SlotLibrary:
    """Compute or read from the cache the tables of every length and depth node.

    `depths_mm` is the range of depths, or one number: depth = that times the length.
    """
    lengths = _nodes(*lengths_mm, LENGTH_RATIO)
    tied = depths_mm if isinstance(depths_mm, float) else None
    depths = np.array([np.nan]) if isinstance(depths_mm, float) else _nodes(*depths_mm, DEPTH_RATIO)
    grid = _shared_grid(coil, float(lengths[-1]), largest_lift_off_mm)
    shape = (len(lengths), len(depths), len(grid.x_mm), len(grid.y_mm), len(grid.lift_off_mm))
    values = np.empty(shape, dtype=np.complex128)
    for i, length in enumerate(lengths):
        for j, depth in enumerate(depths):
            deep = float(depth) if tied is None else tied * float(length)
            slot = Slot(length_mm=float(length), depth_mm=deep, opening_mm=opening_mm)
            values[i, j] = slot_table(slot, coil, conductor, frequency_hz, grid=grid).values
            progress("crack responses", i * len(depths) + j + 1, len(lengths) * len(depths))
    return SlotLibrary(lengths, depths, grid, values, tied)


def _nodes(low: float, high: float, ratio: float) -> Array:
    """Return one node for one value, else at least four that hold [low, high] and are at most `ratio` apart."""
    if high <= low * 1.0001:
        return np.array([low])
    count = max(4, int(np.ceil(np.log(high / low) / np.log(ratio))) + 1)
    return np.geomspace(low, high, count)


def _shared_grid(coil: Coil, longest_mm: float, highest_mm: float) -> TableGrid:
    beside = 3.2 * coil.outer_radius_mm
    scale = 0.3 * (coil.inner_radius_mm + coil.outer_radius_mm)
    heights = scale * np.expm1(np.linspace(0.0, np.log1p(highest_mm / scale), HEIGHTS))
    heights[-1] = highest_mm
    x = np.linspace(0.0, 0.5 * longest_mm + beside, ALONG)
    return TableGrid(tuple(x.tolist()), tuple(np.linspace(0.0, beside, ACROSS).tolist()), tuple(heights.tolist()))


def _between(nodes: Array, values: NDArray[np.complex128], at: float) -> NDArray[np.complex128]:
    """Interpolate the first axis by a cubic through all nodes; one node is the value itself."""
    if len(nodes) == 1:
        return np.asarray(values[0])
    weights = make_interp_spline(nodes, np.eye(len(nodes)), k=3)(at)
    return np.asarray(np.tensordot(np.asarray(weights), values, axes=1))
