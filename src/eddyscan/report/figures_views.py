"""Pictures of what the camera saw."""

from __future__ import annotations

import io

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage
from eddyscan.core.frames import Array
from eddyscan.report.blocks import Picture

WIDTH_PX = 420


def depth_picture(view: DepthImage, width_px: int = WIDTH_PX) -> Picture:
    """Return a depth image as a shaded, coloured PNG; transparent where the camera saw nothing."""
    step = max(1, round(view.camera.width / width_px))
    depth_mm = view.depth_mm[::step, ::step]
    seen = np.isfinite(depth_mm)
    share = float(np.isfinite(view.depth_mm).mean())
    if not seen.any():
        return Picture(_png(np.zeros((*depth_mm.shape, 4))), f"{view.name}: no depth at all", f"empty view {view.name}")
    near, far = np.percentile(depth_mm[seen], (1, 99))
    caption = f"{view.name} · {near:.0f}–{far:.0f} mm · {100 * share:.0f} % of pixels"
    return Picture(_png(_shaded(depth_mm, near, far, step)), caption, f"depth image {view.name}")


def _shaded(depth_mm: Array, near: float, far: float, step: int) -> Array:
    """Colour by depth, lit from the upper left so that the form shows: (H, W, 4) in 0-1."""
    from matplotlib import colormaps

    seen = np.isfinite(depth_mm)
    filled = np.where(seen, depth_mm, np.nanmedian(depth_mm))
    colours = colormaps["viridis_r"](np.clip((filled - near) / max(far - near, 1e-9), 0, 1))
    pixel_mm = max(float(np.median(filled)) / 800.0 * step, 1e-6)
    dy, dx = np.gradient(filled, pixel_mm)
    light = (0.45 * dx + 0.45 * dy + 0.77) / np.sqrt(1 + dx**2 + dy**2)
    colours[..., :3] *= np.clip(0.45 + 0.7 * light, 0.25, 1.1)[..., None]
    colours[..., 3] = seen
    return np.asarray(np.clip(colours, 0, 1))


def cloud_picture(cloud: PointCloud, width_px: int = WIDTH_PX) -> Picture:
    """Return a point cloud seen from above its own frame, coloured by height."""
    from matplotlib import colormaps

    height_px = round(width_px * 0.72)
    canvas = np.zeros((height_px, width_px, 4))
    low, high = np.percentile(cloud.points, (1, 99), axis=0)
    scale = 0.9 * min(width_px / max(high[0] - low[0], 1e-9), height_px / max(high[1] - low[1], 1e-9))
    order = np.argsort(cloud.points[:, 2])
    u, v = ((cloud.points[order, :2] - (low + high)[:2] / 2) * scale + (width_px / 2, height_px / 2)).astype(int).T
    inside = (u >= 0) & (u < width_px) & (v >= 0) & (v < height_px)
    height = np.clip((cloud.points[order, 2] - low[2]) / max(high[2] - low[2], 1e-9), 0, 1)
    canvas[v[inside], u[inside]] = colormaps["viridis"](height[inside])
    caption = f"{cloud.name} · {len(cloud):,} points".replace(",", " ")
    return Picture(_png(canvas), caption, f"point cloud {cloud.name}")


def view_picture(view: DepthImage | PointCloud) -> Picture:
    """Return the picture that fits the kind of view."""
    return depth_picture(view) if isinstance(view, DepthImage) else cloud_picture(view)


def _png(colours: Array) -> bytes:
    from matplotlib.image import imsave

    data = io.BytesIO()
    imsave(data, np.ascontiguousarray(colours), format="png")
    return data.getvalue()
