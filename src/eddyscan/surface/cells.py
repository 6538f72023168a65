"""Ten million points or one: after this there are only cells.

Each view fills its own layer of a height grid with a mean; everything after
works on (views, nx, ny) numbers, whatever the cameras delivered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array

MIN_COUNT = 2
REFERENCE_RANGE_MM = 300.0


@dataclass(frozen=True)
class HeightCells:
    """Mean heights of every view on one grid over the part.

    Attributes
    ----------
    height : (K, nx, ny) [mm], NaN where the view has no sample
    offset : (K, nx, ny, 2) [mm] mean position of the cell's points relative to the cell's centre
    weight : (K, nx, ny) relative; 0 where the view has no sample
    cell_mm : (2,) cell size
    low_mm : (2,) lower corner of the grid
    """

    height: Array
    offset: Array
    weight: Array
    cell_mm: Array
    low_mm: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along x and y."""
        return self.height.shape[1], self.height.shape[2]

    def centres(self) -> tuple[Array, Array]:
        """Return the cell centres along x (nx,) and y (ny,) [mm]."""
        nx, ny = self.shape
        return (
            self.low_mm[0] + (np.arange(nx) + 0.5) * self.cell_mm[0],
            self.low_mm[1] + (np.arange(ny) + 0.5) * self.cell_mm[1],
        )


def cells_of_view(
    points: Array, range_mm: Array, low: Array, cell: Array, shape: tuple[int, int]
) -> tuple[Array, Array, Array]:
    """Bin one view's points: returns height, offset and weight as in `HeightCells`, without the first axis.

    In a cell that spans a wall the points of the upper 3 mm count alone, so
    that wall samples do not pull the edge down.
    """
    at = (points[:, :2] - low) / cell
    index = np.floor(at).astype(np.int64)
    inside = ((index >= 0) & (index < shape)).all(axis=1)
    index, at, points, range_mm = index[inside], at[inside], points[inside], range_mm[inside]
    flat = index[:, 0] * shape[1] + index[:, 1]
    size = shape[0] * shape[1]
    keep = _upper(flat, points[:, 2], size)
    flat, frac, z = flat[keep], (at[keep] - index[keep] - 0.5) * cell, points[keep, 2]
    count = np.bincount(flat, minlength=size).astype(float)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(flat, values, minlength=size) / np.maximum(count, 1))

    enough = count >= MIN_COUNT
    height = np.where(enough, mean(z), np.nan)
    offset = np.stack([mean(frac[:, 0]), mean(frac[:, 1])], axis=1)
    # A stereo camera's depth noise grows with the square of the distance.
    weight = np.where(enough, (REFERENCE_RANGE_MM / np.maximum(mean(range_mm[keep]), 1.0)) ** 4, 0.0)
    return height.reshape(shape), offset.reshape(*shape, 2), weight.reshape(shape)


def _upper(flat: NDArray[np.int64], z: Array, size: int, band_mm: float = 3.0) -> NDArray[np.bool_]:
    top = np.full(size, -np.inf)
    np.maximum.at(top, flat, z)
    return np.asarray(z > top[flat] - band_mm)
