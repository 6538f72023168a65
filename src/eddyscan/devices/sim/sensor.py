"""What an active stereo camera makes of the true depth.

Every term is an option of `WorldCamera`: noise, bias and steps live in
disparity [px], because that is what such a camera measures; losses and edges
are decided per pixel in blobs, not as salt and pepper.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from eddyscan.core.frames import BoolArray
from eddyscan.devices.sim.camera_raycast import Hits
from eddyscan.devices.sim.world_settings import WorldCamera

Image = NDArray[np.float32]

MATCH_WINDOW_PX = 3.0
BIAS_LENGTH_PX = 60.0
EDGE_JUMP_PX = 1.5
EDGE_BAND_PX = 3
BLOB_PX = 2.0
HOLE_PX = 4.0
GARBAGE_PX = 40.0


def gaussian_field(shape: tuple[int, int], length_px: float, rng: np.random.Generator) -> Image:
    """Return a (H, W) normal field of unit variance, correlated over `length_px` (0: white)."""
    if length_px <= 0:
        return rng.standard_normal(shape, dtype=np.float32)
    coarse = max(1, int(length_px // 3))
    small = (shape[0] // coarse + 2, shape[1] // coarse + 2)
    sigma = length_px / coarse
    field = cv2.GaussianBlur(rng.standard_normal(small, dtype=np.float32), (0, 0), sigma)
    field *= np.float32(2 * np.sqrt(np.pi) * sigma)
    if coarse > 1:
        field = cv2.resize(field, (small[1] * coarse, small[0] * coarse), interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(field[: shape[0], : shape[1]])


def blobs(shape: tuple[int, int], share: float, length_px: float, rng: np.random.Generator) -> BoolArray:
    """Return a (H, W) mask that covers `share` of the image in blobs of about `length_px`."""
    if share <= 0:
        return np.zeros(shape, dtype=bool)
    if share >= 1:
        return np.ones(shape, dtype=bool)
    return np.asarray(gaussian_field(shape, length_px, rng) > ndtri(1 - share))


@dataclass(frozen=True)
class StereoSensor:
    """The sensor model of one camera; its bias map belongs to the camera, not to a view."""

    options: WorldCamera
    focal_px: float
    bias_px: Image

    @classmethod
    def made(cls, options: WorldCamera, focal_px: float, shape: tuple[int, int], seed: int) -> StereoSensor:
        """Make the camera's own bias map from `seed`."""
        field = gaussian_field(shape, BIAS_LENGTH_PX, np.random.default_rng([seed, 60]))
        return cls(options, focal_px, np.float32(options.bias_map_px) * field)

    def depth(self, hits: Hits, metal: BoolArray, rng: np.random.Generator) -> Image:
        """Return the depth image (H, W) [mm] that the sensor delivers; NaN = no return.

        Parameters
        ----------
        hits : Hits
        metal : (H, W) bool
            Pixels on shiny metal, which can glare.
        rng : Generator
            Noise of this view.
        """
        scale = self.focal_px * self.options.baseline_mm
        true_px = np.where(np.isfinite(hits.depth_mm), scale / np.maximum(hits.depth_mm, 1.0), 0.0).astype(np.float32)
        seen_px, lost = self._edges(true_px, rng)
        seen_px, lost = self._occlusion(true_px, seen_px, lost, rng)
        measured_px = self._measured(seen_px, hits.facing, rng)
        lost |= self._faded(hits, metal, rng) | (true_px <= 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = scale / measured_px * (1 + self.options.depth_scale_error)
        near, far = self.options.range_mm
        lost |= ~((depth >= near) & (depth <= far))
        depth[lost] = np.nan
        return np.asarray(depth, dtype=np.float32)

    def _measured(self, true_px: Image, facing: Image, rng: np.random.Generator) -> Image:
        """Add bias, locking, static and temporal noise and the disparity steps; average the frames."""
        o, shape = self.options, true_px.shape
        slant = 1.0 / np.sqrt(np.clip(facing, 0.1, 1.0))
        fixed = true_px + self.bias_px
        if o.pixel_locking_px > 0:
            fixed += np.float32(o.pixel_locking_px) * np.sin(np.float32(2 * np.pi) * true_px)
        if o.noise_static_px > 0:
            fixed += np.float32(o.noise_static_px) * slant * gaussian_field(shape, MATCH_WINDOW_PX, rng)
        total = np.zeros(shape, dtype=np.float32)
        for _ in range(o.frames):
            frame = fixed
            if o.noise_white_px > 0 or o.noise_correlated_px > 0:
                temporal = np.float32(o.noise_white_px) * gaussian_field(shape, 0, rng)
                temporal += np.float32(o.noise_correlated_px) * gaussian_field(shape, MATCH_WINDOW_PX, rng)
                frame = fixed + slant * temporal
            if o.disparity_step_px > 0:
                frame = np.round(frame / np.float32(o.disparity_step_px)) * np.float32(o.disparity_step_px)
            total += frame
        return np.asarray(total / np.float32(o.frames), dtype=np.float32)

    def _edges(self, true_px: Image, rng: np.random.Generator) -> tuple[Image, BoolArray]:
        """Fatten, smear or lose the pixels beside a jump of disparity."""
        o = self.options
        three = np.ones((3, 3), np.uint8)
        jump = (cv2.dilate(true_px, three) - cv2.erode(true_px, three)) > EDGE_JUMP_PX
        size = 2 * EDGE_BAND_PX + 1
        window = np.ones((size, size), np.uint8)
        band = cv2.dilate(jump.astype(np.uint8), window).astype(bool)
        at = np.nonzero(band)
        fore, back = cv2.dilate(true_px, window)[at], cv2.erode(true_px, window)[at]
        fate = gaussian_field(true_px.shape, BLOB_PX, rng)[at]
        lows = [
            ndtri(min(max(share, 1e-9), 1 - 1e-9))
            for share in np.cumsum([o.edge_fattening, o.edge_flying, o.edge_lost])
        ]
        values = true_px[at]
        mix = rng.random(len(values), dtype=np.float32)
        values = np.where(fate < lows[0], fore, values)
        values = np.where((fate >= lows[0]) & (fate < lows[1]), back + mix * (fore - back), values)
        seen = true_px.copy()
        seen[at] = values
        lost = np.zeros(true_px.shape, dtype=bool)
        lost[at] = (fate >= lows[1]) & (fate < lows[2])
        return seen, lost

    def _occlusion(
        self, true_px: Image, seen_px: Image, lost: BoolArray, rng: np.random.Generator
    ) -> tuple[Image, BoolArray]:
        """Lose what the right camera cannot see: a nearer pixel to the right lands on the same spot."""
        column = np.arange(true_px.shape[1], dtype=np.float32)
        right = column - true_px
        nearest = np.minimum.accumulate(right[:, ::-1], axis=1)[:, ::-1]
        hidden = np.zeros(true_px.shape, dtype=bool)
        hidden[:, :-1] = nearest[:, 1:] < right[:, :-1] - 0.5
        gone = blobs(true_px.shape, self.options.occlusion_lost, BLOB_PX, rng)
        garbage = hidden & ~gone
        seen_px[garbage] += rng.uniform(-GARBAGE_PX, GARBAGE_PX, int(garbage.sum())).astype(np.float32)
        return seen_px, lost | (hidden & gone)

    def _faded(self, hits: Hits, metal: BoolArray, rng: np.random.Generator) -> BoolArray:
        """Return the pixels without return: grazing incidence, glare on metal, random holes."""
        o, shape = self.options, hits.depth_mm.shape
        angle = np.degrees(np.arccos(hits.facing))
        start, end = o.incidence_deg
        faded = ndtr(gaussian_field(shape, BLOB_PX, rng)) < (angle - start) / max(end - start, 1e-6)
        glare = metal & (angle < o.highlight_deg) & blobs(shape, o.highlight_lost, HOLE_PX, rng)
        return np.asarray(faded | glare | blobs(shape, o.holes, HOLE_PX, rng))
