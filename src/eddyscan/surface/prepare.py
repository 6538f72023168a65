"""From what was read to cleaned views."""

from __future__ import annotations

import numpy as np

from eddyscan.core.depth import DepthImage
from eddyscan.core.errors import GeometryError
from eddyscan.core.technique import Surface
from eddyscan.surface.clean import Depth32, clean
from eddyscan.surface.surfels import surfel_image
from eddyscan.surface.view import View

MIN_PIXELS = 1000


def prepare(view: DepthImage, settings: Surface) -> View:
    """Clean one depth image and fit its surfels; the pose is the camera's own until registration.

    Raises
    ------
    GeometryError
        When the range gate leaves nothing.
    """
    depth = clean(view.depth_mm, near_mm=settings.range_min_mm, far_mm=settings.range_max_mm)
    kept = int(np.isfinite(depth).sum())
    if kept < MIN_PIXELS:
        raise GeometryError(_nothing_left(view, settings, kept))
    surfels = surfel_image(depth, view.camera)
    return View(view.name, depth, _gated(view, settings), view.camera, surfels, np.eye(4))


def _gated(view: DepthImage, settings: Surface) -> Depth32:
    inside = (view.depth_mm >= settings.range_min_mm) & (view.depth_mm <= settings.range_max_mm)
    return np.where(inside, view.depth_mm, np.nan).astype(np.float32)


def _nothing_left(view: DepthImage, settings: Surface, kept: int) -> str:
    valid = view.depth_mm[np.isfinite(view.depth_mm)]
    if valid.size == 0:
        return f"{view.name} holds no depth at all (every pixel is empty or NaN). Take it again."
    middle = float(np.median(valid))
    hint = "Move the camera, or widen range_min_mm and range_max_mm."
    if middle < 5.0:
        hint = f"A median of {middle:.3g} mm looks like metres: check depth_scale_mm or the cloud's unit."
    return (
        f"{view.name} has {kept} usable pixels between {settings.range_min_mm:.0f} and {settings.range_max_mm:.0f} mm "
        f"(need {MIN_PIXELS}); its depths run from {valid.min():.4g} to {valid.max():.4g} mm. {hint}"
    )
