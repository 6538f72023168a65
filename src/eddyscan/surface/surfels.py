"""One view prepared for registration: small oriented planes on a half-size pixel grid.

In a pinhole image a plane is an affine function of the pixel in *inverse*
depth, 1/z = A x/z + B y/z + C, so a window's plane is a linear fit with a
handful of box filters, and its noise is uniform because a stereo camera's
disparity is 1/z times a constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import Array
from eddyscan.surface.clean import Depth32

WINDOW_RADIUS = 3  # half-size pixels: 14 px of the image, about 5 mm at 300 mm
MIN_FILL = 0.45  # share of the window that must be valid
RESIDUAL_LIMIT = 3.0  # a window whose residual exceeds this many medians spans a crease


@dataclass(frozen=True)
class SurfelImage:
    """Smoothed points and normals of a view at half resolution.

    Attributes
    ----------
    points : (h, w, 3) float32 [mm, camera frame]; NaN where there is none
    normals : (h, w, 3) float32 unit, towards the camera
    camera : PinholeCamera of this pixel grid
    """

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    camera: PinholeCamera

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(h, w) where there is a surfel."""
        return np.isfinite(self.points[..., 2])


def half_camera(camera: PinholeCamera) -> PinholeCamera:
    """Return the camera of the image averaged over 2 x 2 pixels."""
    return PinholeCamera(
        fx=camera.fx / 2,
        fy=camera.fy / 2,
        cx=(camera.cx + 0.5) / 2 - 0.5,
        cy=(camera.cy + 0.5) / 2 - 0.5,
        width=camera.width // 2,
        height=camera.height // 2,
        depth_scale_mm=camera.depth_scale_mm,
    )


def surfel_image(depth: Depth32, camera: PinholeCamera) -> SurfelImage:
    """Fit a plane in inverse depth to the window round every half-size pixel.

    Parameters
    ----------
    depth : (H, W) float32 [mm], cleaned, NaN = none
    camera : PinholeCamera
    """
    import cv2

    half = half_camera(camera)
    even = depth[: 2 * half.height, : 2 * half.width]
    valid = np.isfinite(even)
    inverse = np.where(valid, 1.0 / np.where(valid, even, 1.0), 0.0).astype(np.float32)
    size = (half.width, half.height)
    weight = cv2.resize(valid.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    moment = cv2.resize(inverse, size, interpolation=cv2.INTER_AREA)
    slope_u, slope_v, level, ok = _affine_fit(cv2, weight, moment)
    ok &= weight > 0
    x = ((np.arange(half.width) - half.cx) / half.fx).astype(np.float32)
    y = ((np.arange(half.height) - half.cy) / half.fy).astype(np.float32)[:, None]
    a, b = slope_u * half.fx, slope_v * half.fy
    normals = -np.stack([a, b, level - a * x - b * y], axis=-1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    z = np.where(ok & (level > 0), 1.0 / np.where(level > 0, level, 1.0), np.nan)
    points = np.stack([x * z, y * z, z], axis=-1)
    return SurfelImage(points.astype(np.float32), normals.astype(np.float32), half)


def _affine_fit(cv2: Any, weight: Depth32, moment: Depth32) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Weighted linear fit m(u, v) = level + slope_u du + slope_v dv in every window."""
    r = WINDOW_RADIUS
    one, ramp = np.ones(2 * r + 1, np.float32), np.arange(-r, r + 1, dtype=np.float32)

    def window(image: Depth32, along_u: Any, along_v: Any) -> Array:
        return np.asarray(cv2.sepFilter2D(image, cv2.CV_32F, along_u, along_v, borderType=cv2.BORDER_CONSTANT))

    scale = np.float32(1.0 / max(float(moment.sum()) / max(float(weight.sum()), 1e-9), 1e-12))
    scaled = moment * scale
    n, su, sv = window(weight, one, one), window(weight, ramp, one), window(weight, one, ramp)
    suu, svv, suv = window(weight, ramp**2, one), window(weight, one, ramp**2), window(weight, ramp, ramp)
    m, mu, mv = window(scaled, one, one), window(scaled, ramp, one), window(scaled, one, ramp)
    square = window(np.divide(scaled**2, weight, out=np.zeros_like(scaled), where=weight > 0), one, one)
    safe = np.maximum(n, 1e-6)
    cuu, cvv, cuv = suu - su * su / safe, svv - sv * sv / safe, suv - su * sv / safe
    cmu, cmv = mu - m * su / safe, mv - m * sv / safe
    determinant = cuu * cvv - cuv**2
    ok = (n > MIN_FILL * len(one) ** 2) & (determinant > 0.05 * (len(one) ** 2 * r * r / 3) ** 2 * MIN_FILL)
    determinant = np.where(ok, determinant, 1.0)
    slope_u, slope_v = (cmu * cvv - cmv * cuv) / determinant, (cmv * cuu - cmu * cuv) / determinant
    level = (m - slope_u * su - slope_v * sv) / safe
    residual = np.maximum(square - m * m / safe - slope_u * cmu - slope_v * cmv, 0) / safe
    if ok.any():
        ok &= residual < RESIDUAL_LIMIT**2 * float(np.median(residual[ok])) + 1e-10
    return slope_u / scale, slope_v / scale, level / scale, np.asarray(ok)
