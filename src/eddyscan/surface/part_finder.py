"""Find which of the things on the table is the part, and its footprint's box.

Rule: objects are connected footprints higher than 3 mm. Each is weighed by its
seen area times how central it stands in the views (a Gaussian of the distance
to where the cameras look, averaged over the views). The heaviest is the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array, apply, rotation_about_z, transform
from eddyscan.surface.view import View

CELL_MM = 2.0
OBJECT_MM = 3.0
CENTRAL_MM = 120.0
RIVAL_SHARE = 0.5
MIN_CELLS = 30


@dataclass(frozen=True)
class PartRegion:
    """The part's footprint.

    Attributes
    ----------
    T_box_world : (4, 4) takes the table frame to the footprint's min-area box: x along the long side, origin at its
        corner, z up from the table
    size_mm : (3,) of the box; the third is the part's height
    mask : (nx, ny) bool footprint in the box frame on CELL_MM cells, padded by `pad` cells
    pad : int
    rivals : names of other objects that could have been the part
    touches_border : bool
        The footprint runs out of what the cameras saw.
    """

    T_box_world: Array
    size_mm: Array
    mask: NDArray[np.bool_]
    pad: int
    rivals: tuple[str, ...]


def find_part(views: Sequence[View]) -> PartRegion:
    """Find the part's footprint among everything that stands on the table.

    Raises
    ------
    RegistrationError
        When nothing stands on the table.
    """
    import cv2

    points = np.concatenate([_tall(v) for v in views])
    if len(points) < MIN_CELLS:
        raise RegistrationError(
            f"nothing higher than {OBJECT_MM} mm stands on the table ({len(points)} points): "
            "no part to reconstruct. Check the range limits and that the part is in the picture."
        )
    low = points[:, :2].min(axis=0) - 2 * CELL_MM
    shape = np.ceil((points[:, :2].max(axis=0) - low) / CELL_MM).astype(int) + 3
    cell = ((points[:, :2] - low) / CELL_MM).astype(int)
    count = np.bincount(cell[:, 0] * shape[1] + cell[:, 1], minlength=int(shape.prod())).reshape(shape)
    solid = cv2.morphologyEx((count >= 2).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    solid = cv2.morphologyEx(solid, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    label_count, label, stats, centroid = cv2.connectedComponentsWithStats(solid, connectivity=8)
    if label_count < 2:
        raise RegistrationError(f"nothing larger than {2 * CELL_MM} mm stands on the table: no part to reconstruct.")
    centres = centroid[1:, ::-1] * CELL_MM + low
    aim = np.array([_aim(v) for v in views])
    central = np.exp(-0.5 * (np.linalg.norm(centres[:, None] - aim[None], axis=2) / CENTRAL_MM) ** 2).mean(axis=1)
    weight = stats[1:, cv2.CC_STAT_AREA] * central
    best = int(np.argmax(weight))
    rivals = tuple(
        f"object of {stats[k + 1, cv2.CC_STAT_AREA] * CELL_MM**2:.0f} mm2 at ({centres[k, 0]:.0f}, {centres[k, 1]:.0f})"
        for k in np.nonzero(weight > RIVAL_SHARE * weight[best])[0]
        if k != best
    )
    chosen = (label == best + 1)[cell[:, 0], cell[:, 1]]
    return _boxed(points[chosen], rivals)


def _tall(view: View) -> Array:
    valid = view.surfels.valid
    points = apply(view.T_world_camera, view.surfels.points[valid].astype(np.float64))
    return points[points[:, 2] > OBJECT_MM]


def _aim(view: View) -> Array:
    """Return where the optical axis meets the table (2,) [mm]."""
    origin, axis = view.T_world_camera[:3, 3], view.T_world_camera[:3, 2]
    reach = -origin[2] / axis[2] if axis[2] < -0.1 else 300.0
    return np.asarray((origin + reach * axis)[:2])


def _boxed(points: Array, rivals: tuple[str, ...]) -> PartRegion:
    import cv2

    xy = np.unique(np.floor(points[:, :2] / (CELL_MM / 2)).astype(np.int32), axis=0).astype(np.float32)
    centre, _, angle = cv2.minAreaRect((xy + 0.5) * np.float32(CELL_MM / 2))
    turned = points[:, :2] @ rotation_about_z(angle)[:2, :2]
    extent = np.ptp(turned, axis=0)
    if extent[1] > extent[0]:
        angle += 90.0
    R = rotation_about_z(-angle)
    turned = points @ R.T
    low, high = turned[:, :2].min(axis=0), turned[:, :2].max(axis=0)
    top = float(np.quantile(turned[:, 2], 0.999))
    T = transform(R, (-low[0], -low[1], 0.0))
    pad = 4
    cell = np.floor((turned[:, :2] - low) / CELL_MM).astype(int) + pad
    shape = np.floor((high - low) / CELL_MM).astype(int) + 1 + 2 * pad
    mask = np.zeros(shape, np.uint8)
    mask[cell[:, 0], cell[:, 1]] = 1
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    del centre
    return PartRegion(T, np.array([*(high - low), top]), mask > 0, pad, rivals)
