"""Views as height maps over the table, for finding out where the cameras stood."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.frames import Array, apply
from eddyscan.surface.surfels import SurfelImage

CELL_MM = 2.0
HALF_MM = 258.0  # half the side of a map
COARSE = 3  # fine cells per coarse cell
OBJECT_MM = 3.0  # lower than this is table
CEILING_MM = 150.0


@dataclass(frozen=True)
class HeightMap:
    """Mean height over the table per cell, in one view's table frame.

    Attributes
    ----------
    height : (n, n) float32 [mm], first index x; 0 where unseen
    seen : (n, n) bool
    centre_mm : (2,) table position of the map's middle
    """

    height: NDArray[np.float32]
    seen: NDArray[np.bool_]
    centre_mm: Array

    def coarse(self) -> tuple[Array, Array]:
        """Return height and seen at a third of the resolution: (m, m) each, seen as 0 or 1."""
        n = self.height.shape[0] // COARSE * COARSE
        blocks = (n // COARSE, COARSE, n // COARSE, COARSE)
        count = self.seen[:n, :n].reshape(blocks).sum(axis=(1, 3)).astype(float)
        total = (self.height * self.seen)[:n, :n].reshape(blocks).sum(axis=(1, 3)).astype(float)
        return np.divide(total, count, out=np.zeros_like(total), where=count > 0), (count > 0).astype(float)

    def samples(self, limit: int, rng: np.random.Generator) -> Array:
        """Return up to `limit` seen cells (N, 3) x, y, height [mm, table]: objects first, then their surroundings."""
        thick = _grown(self.seen & (self.height > OBJECT_MM), 6)
        i, j = np.nonzero(self.seen & thick)
        if len(i) > limit:
            pick = rng.choice(len(i), limit, replace=False)
            i, j = i[pick], j[pick]
        half = self.height.shape[0] / 2
        x = (i + 0.5 - half) * CELL_MM + self.centre_mm[0]
        y = (j + 0.5 - half) * CELL_MM + self.centre_mm[1]
        return np.stack([x, y, self.height[i, j].astype(float)], axis=1)

    def look_up(self, xy: Array) -> Array:
        """Return the height at (..., 2) table positions [mm], NaN where unseen."""
        n = self.height.shape[0]
        cell = ((xy - self.centre_mm) / CELL_MM + (n / 2 + 1)).astype(np.int64)  # one cell of NaN all round
        np.clip(cell, 0, n + 1, out=cell)
        return np.asarray(self._bordered.ravel()[cell[..., 0] * (n + 2) + cell[..., 1]])

    @cached_property
    def _bordered(self) -> Array:
        return np.pad(np.where(self.seen, self.height, np.nan).astype(np.float64), 1, constant_values=np.nan)


def _grown(mask: NDArray[np.bool_], cells: int) -> NDArray[np.bool_]:
    import cv2

    box = np.ones((2 * cells + 1, 2 * cells + 1), np.uint8)
    return np.asarray(cv2.dilate(mask.astype(np.uint8), box) > 0)


def height_map(image: SurfelImage, T_table_camera: Array) -> HeightMap:
    """Bin a view's surfels over the table.

    The map is centred on the objects the view shows, so that a part anywhere
    in the picture stays inside.
    """
    points = apply(T_table_camera, image.points[image.valid].astype(np.float64))
    tall = (points[:, 2] > OBJECT_MM) & (points[:, 2] < CEILING_MM)
    centre = np.median(points[tall, :2], axis=0) if tall.any() else np.zeros(2)
    n = int(2 * HALF_MM / CELL_MM)
    cell = np.floor((points[:, :2] - centre) / CELL_MM + n / 2).astype(np.int64)
    inside = ((cell >= 0) & (cell < n)).all(axis=1) & (np.abs(points[:, 2]) < CEILING_MM)
    flat = cell[inside, 0] * n + cell[inside, 1]
    count = np.bincount(flat, minlength=n * n)
    total = np.bincount(flat, points[inside, 2], minlength=n * n)
    height = np.divide(total, count, out=np.zeros(n * n), where=count > 0)
    return HeightMap(height.reshape(n, n).astype(np.float32), (count > 0).reshape(n, n), np.asarray(centre))
