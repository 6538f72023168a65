"""Where did the cameras stand? Yaw, x and y between table frames, with no guess.

Every pair of height maps is compared at every yaw and every shift by FFT
correlation of the masked squared difference; the best few are refined on fine
maps with a truncated cost, so that a hidden side or a moved speck cannot
outvote the part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import affine_transform

from eddyscan.core.frames import Array, rotation_about_z
from eddyscan.surface.height_map import CELL_MM, COARSE, HeightMap

YAWS = 60
CANDIDATES = 5
TRUNCATE_MM = 6.0
MIN_OVERLAP = 0.3  # share of the smaller view's objects that the other must have seen
SAMPLES = 1500
REFINED = 3  # coarse peaks worth refining
FINEST_MM = 0.7  # steps below this are left to the point-to-plane registration
FFT_SIZE = 180  # coarse maps are 86 cells: twice that, no wrap-around


@dataclass(frozen=True)
class PairPose:
    """How view `source` lies in the table frame of view `target`.

    Attributes
    ----------
    T_target_source : (4, 4) between table frames: yaw about z and a shift in the plane
    cost_mm : float
        Mean truncated height difference; lower is better.
    overlap : float
        Share of the source's object cells that the target has seen.
    rival_cost_mm : float
        Cost of the best pose that differs by more than 20 deg or 20 mm.
    rival_yaw_deg : float
        Yaw of that rival relative to the best.
    """

    target: int
    source: int
    T_target_source: Array
    cost_mm: float
    overlap: float
    rival_cost_mm: float = np.inf
    rival_yaw_deg: float = 0.0


@dataclass(frozen=True)
class _Spectra:
    height: NDArray[np.complex64]
    square: NDArray[np.complex64]
    seen: NDArray[np.complex64]


def _spectra(height: Array, seen: Array) -> _Spectra:
    size = (FFT_SIZE, FFT_SIZE)
    layers = (height, height * height, seen)
    return _Spectra(*(np.asarray(fft.rfft2(a.astype(np.float32), size), dtype=np.complex64) for a in layers))


def _turned(height: Array, seen: Array, yaw_deg: float) -> tuple[Array, Array]:
    """Rotate a coarse map about its middle by yaw (source to target)."""
    R = rotation_about_z(-yaw_deg)[:2, :2]
    middle = (np.array(height.shape) - 1) / 2
    offset = middle - R @ middle
    turned = affine_transform(height, R, offset, order=1)
    mask = affine_transform(seen, R, offset, order=1) > 0.7
    return turned * mask, mask.astype(float)


class PairSearch:
    """Holds the spectra of all views so that all pairs cost little more than one."""

    def __init__(self, maps: Sequence[HeightMap], *, seed: int = 0) -> None:
        self.maps = maps
        self._coarse = [m.coarse() for m in maps]
        rng = np.random.default_rng(seed)
        self.samples = [m.samples(SAMPLES, rng) for m in maps]
        self._still = [_spectra(h, s) for h, s in self._coarse]
        self._turned: dict[int, list[_Spectra]] = {}

    def pair(self, target: int, source: int) -> PairPose:
        """Return the best pose of `source` in `target`'s table frame and its best rival."""
        if source not in self._turned:
            angles = np.arange(YAWS) * 360.0 / YAWS
            self._turned[source] = [_spectra(*_turned(*self._coarse[source], a)) for a in angles]
        candidates = self._candidates(target, source)
        if not candidates:
            return PairPose(target, source, np.eye(4), np.inf, 0.0)
        best = candidates[0]
        rival, rival_yaw = np.inf, 0.0
        for pose, cost, _ in candidates[1:]:
            yaw = _yaw_between(pose[0], best[0][0])
            if abs(yaw) > 20 or np.hypot(*(pose[1:] - best[0][1:])) > 20:
                rival, rival_yaw = cost, yaw
                break
        return PairPose(target, source, self.pose_matrix(target, source, best[0]), best[1], best[2], rival, rival_yaw)

    def _candidates(self, target: int, source: int) -> list[tuple[Array, float, float]]:
        """Return refined (pose, cost, overlap), best first: the coarse peaks that a first look leaves."""
        peaks = [
            (p, self.cost(target, source, self.pose_matrix(target, source, p))[0]) for p in self._peaks(target, source)
        ]
        peaks.sort(key=lambda p: p[1])
        refined = [self._refine(target, source, p) for p, _ in peaks[:REFINED]]
        return sorted(refined, key=lambda c: c[1])

    def pose_matrix(self, target: int, source: int, pose: Array) -> Array:
        """Return T_target_source for yaw [deg] and the shift [mm] between the maps' middles."""
        c, s = np.cos(np.radians(pose[0])), np.sin(np.radians(pose[0]))
        T = np.eye(4)
        T[:2, :2] = [[c, -s], [s, c]]
        T[:2, 3] = self.maps[target].centre_mm + pose[1:] - T[:2, :2] @ self.maps[source].centre_mm
        return T

    def cost(self, target: int, source: int, T_target_source: Array) -> tuple[float, float]:
        """Return the mean truncated height difference [mm] and the overlap at a pose, both ways."""
        forth = self._one_way(target, source, T_target_source[:2, :2], T_target_source[:2, 3])
        R = T_target_source[:2, :2].T
        back = self._one_way(source, target, R, -R @ T_target_source[:2, 3])
        return (forth[0] + back[0]) / 2, min(forth[1], back[1])

    def _one_way(self, target: int, source: int, R: Array, t: Array) -> tuple[float, float]:
        cells = self.samples[source]
        height = self.maps[target].look_up(cells[:, :2] @ R.T + t)
        seen = np.isfinite(height)
        if seen.sum() < 50:
            return TRUNCATE_MM, 0.0
        difference = np.minimum(np.abs(height[seen] - cells[seen, 2]), TRUNCATE_MM)
        return float(difference.mean()), float(seen.mean())

    def _peaks(self, target: int, source: int) -> list[Array]:
        """Return the best distinct (yaw deg, x mm, y mm) of the coarse search."""
        a = self._still[target]
        least = MIN_OVERLAP * float((self._coarse[source][0] ** 2).sum())
        found: list[tuple[float, float, float, float]] = []
        step = CELL_MM * COARSE
        for k, b in enumerate(self._turned[source]):
            norm = fft.irfft2(a.square * b.seen.conj() + a.seen * b.square.conj(), (FFT_SIZE, FFT_SIZE))
            cross = fft.irfft2(a.height * b.height.conj(), (FFT_SIZE, FFT_SIZE))
            score = np.where(norm > 2 * least, 2 * cross / np.maximum(norm, least), -1)
            for _ in range(2):
                at = np.unravel_index(int(np.argmax(score)), score.shape)
                shift = [(int(i) + FFT_SIZE // 2) % FFT_SIZE - FFT_SIZE // 2 for i in at]
                found.append((float(score[at]), k * 360.0 / YAWS, shift[0] * step, shift[1] * step))
                rows, columns = [(np.arange(-4, 5) + int(i)) % FFT_SIZE for i in at]
                score[np.ix_(rows, columns)] = -1
        return _distinct(found)

    def _refine(self, target: int, source: int, start: Array) -> tuple[Array, float, float]:
        """Pattern search on the fine maps; returns pose, cost and overlap."""
        pose = start.copy()

        def cost(p: Array) -> tuple[float, float]:
            c, overlap = self.cost(target, source, self.pose_matrix(target, source, p))
            return c + max(0.0, MIN_OVERLAP - overlap) * TRUNCATE_MM, overlap

        best = cost(pose)
        step = np.array([3.0, 4.0, 4.0])
        while step[1] > FINEST_MM:
            moved = False
            for axis in range(3):
                for sign in (1, -1):
                    trial = pose.copy()
                    trial[axis] += sign * step[axis]
                    value = cost(trial)
                    if value[0] < best[0] - 1e-6:
                        pose, best, moved = trial, value, True
                        break
            if not moved:
                step /= 2
        return pose, best[0], best[1]


def _yaw_between(a: float, b: float) -> float:
    return float((a - b + 180.0) % 360.0 - 180.0)


def _distinct(found: list[tuple[float, float, float, float]]) -> list[Array]:
    kept: list[Array] = []
    for score, *pose in sorted(found, reverse=True):
        if score < 0:
            break
        candidate = np.array(pose)
        apart = (abs(_yaw_between(candidate[0], k[0])) > 9 or np.hypot(*(candidate[1:] - k[1:])) > 15 for k in kept)
        if all(apart):
            kept.append(candidate)
        if len(kept) == CANDIDATES:
            break
    return kept
