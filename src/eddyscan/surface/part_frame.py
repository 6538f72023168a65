"""Find the part among the registered views and put its frame on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.surface.axes import align
from eddyscan.surface.outline import Outline, trace_outline
from eddyscan.surface.part_finder import CELL_MM, OBJECT_MM, PartRegion, find_part
from eddyscan.surface.view import View


@dataclass(frozen=True)
class PartFrame:
    """The part's frame and outline.

    Attributes
    ----------
    T_part_world : (4, 4)
    size_mm : (3,) of the outline's bounding box and the height
    outline : Outline in the part frame
    warnings : tuple of str
    """

    T_part_world: Array
    size_mm: Array
    outline: Outline
    warnings: tuple[str, ...]

    def box(self, margin_mm: float) -> tuple[Array, Array]:
        """Return the limits of the part's box, widened sideways and upwards, from just above the table."""
        low = np.array([-margin_mm, -margin_mm, 0.5])
        return low, self.size_mm + margin_mm


def locate_part(views: Sequence[View]) -> PartFrame:
    """Find the part, its outline and its frame."""
    region = find_part(views)
    margin = 6.0
    low, high = np.array([-margin, -margin, 0.5]), region.size_mm + margin
    points = np.concatenate([_on_region(region, v.points_in(region.T_box_world, low, high)[0]) for v in views])
    surfels = [v.surfels_in(region.T_box_world, low + np.array([0, 0, 1.0]), high) for v in views]
    walls, normals = (np.concatenate([s[k] for s in surfels]) for k in range(2))
    outline = trace_outline(points[points[:, 2] > _foot_height(region)], walls, normals)
    axes = align(outline, points)
    T = axes.T_part_box @ region.T_box_world
    warnings = list(axes.warnings)
    if region.rivals:
        warnings.append("other objects could be the part: " + "; ".join(region.rivals) + ". Clear the table or crop.")
    return PartFrame(T, np.array([*axes.size_mm, region.size_mm[2]]), outline.moved(axes.T_part_box), tuple(warnings))


def _foot_height(region: PartRegion) -> float:
    """Return the height [mm] above which a point cannot be the table's noise."""
    return float(min(OBJECT_MM, 0.4 * region.size_mm[2]))


def _on_region(region: PartRegion, points: Array) -> Array:
    """Keep points over the part's own footprint, one cell of margin, so that neighbours stay out."""
    import cv2

    grown = cv2.dilate(region.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    cell = np.floor(points[:, :2] / CELL_MM).astype(int) + region.pad
    inside = ((cell >= 0) & (cell < grown.shape)).all(axis=1)
    keep = np.zeros(len(points), dtype=bool)
    keep[inside] = grown[cell[inside, 0], cell[inside, 1]]
    return points[keep]
