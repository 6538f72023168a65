"""A noisy closed contour as sides: straight where it is straight, a smooth curve where it is not.

Parts are cut with straight or smoothly curved borders that meet in corners;
what the cameras add is noise of a millimetre over a few millimetres. Sides are
therefore fitted whole, robustly, away from their corners, and corners are where
neighbouring sides meet.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from eddyscan.core.frames import Array

CORNER_MM = 3.0  # a corner stands out from the chord of its neighbours by more than this
ROUGH_CORNER_MM = 5.0
SIDE_MIN_MM = 25.0
TRIM_MM = 8.0  # the contour is rounded this near a corner
WAVE_MM = 8.0  # a fit's residual is judged after smoothing over this length
FIT_LIMIT_MM = 0.3
FIT_SHARE = 0.75  # of the side must follow the fit; the rest may be bites, burrs or the camera's patches
DEGREES = (1, 2, 4, 6)
UNKNOWN_WEIGHT = 0.1


@dataclass(frozen=True)
class _Side:
    """A side as offset(t) from its chord.

    Attributes
    ----------
    origin, along, across : (2,) chord's start and unit directions
    length_mm : of the chord
    curve : Polynomial in t [mm]
    """

    origin: Array
    along: Array
    across: Array
    length_mm: float
    curve: Polynomial

    @property
    def straight(self) -> bool:
        return self.curve.degree() == 1

    def at(self, t: Array) -> Array:
        """Return points (N, 2) at chord positions (N,) [mm]."""
        return np.asarray(self.origin + np.outer(t, self.along) + np.outer(self.curve(t), self.across))

    def end(self, last: bool) -> tuple[Array, Array]:
        """Return a point and the direction of the side at its end."""
        t = self.length_mm if last else 0.0
        direction = self.along + self.curve.deriv()(t) * self.across
        return self.at(np.array([t]))[0], direction / np.linalg.norm(direction)


def straightened(
    loop: Array, known: NDArray[np.bool_], spacing_mm: float = 1.0, *, rough: bool = False
) -> tuple[Array, Array, Array]:
    """Fit the sides of a closed contour.

    Parameters
    ----------
    loop : (S, 2) [mm], evenly spaced, counter-clockwise
    known : (S,) samples that something has measured; others count little
    rough : bool
        Bridge bites that a first look may only have missed.

    Returns
    -------
    polygon : (M, 2) [mm]
    straight_deg, straight_mm : (L,) direction and length of the straight sides
    """
    import cv2

    corners = cv2.approxPolyDP(loop.astype(np.float32)[:, None], ROUGH_CORNER_MM if rough else CORNER_MM, True)[:, 0]
    starts = sorted({int(np.argmin(np.linalg.norm(loop - c, axis=1))) for c in corners})
    runs = [np.arange(a, b + 1) % len(loop) for a, b in pairwise([*starts, starts[0] + len(loop)])]
    sides = [_fitted(loop[r], known[r], spacing_mm) for r in runs]
    kept = [
        k
        for k in range(len(runs))
        if not _unmeasured_corner(runs[k], known, sides[k], sides[k - 1], sides[(k + 1) % len(sides)])
    ]
    runs, sides = [runs[k] for k in kept], [sides[k] for k in kept]
    smooth = gaussian_filter1d(loop, 4.0 / spacing_mm, axis=0, mode="wrap")
    pieces = [_piece(sides[k - 1], sides[k], sides[(k + 1) % len(sides)], smooth[r]) for k, r in enumerate(runs)]
    straight = [s for s in sides if s is not None and s.straight]
    directions = [float(np.degrees(np.arctan2(*s.end(False)[1][::-1]))) for s in straight]
    return _without_repeats(np.concatenate(pieces)), np.array(directions), np.array([s.length_mm for s in straight])


def _unmeasured_corner(
    run: NDArray[np.int64], known: NDArray[np.bool_], side: _Side | None, before: _Side | None, after: _Side | None
) -> bool:
    """Say whether a short run between two fitted sides is only the first look's guess: then the sides meet."""
    return side is None and before is not None and after is not None and float(known[run].mean()) < 0.5


def _fitted(points: Array, known: NDArray[np.bool_], spacing_mm: float) -> _Side | None:
    """Return the simplest robust fit of a run, or None when it is short or follows no smooth curve."""
    chord = points[-1] - points[0]
    length = float(np.linalg.norm(chord))
    if length < SIDE_MIN_MM:
        return None
    along = chord / length
    across = np.array([-along[1], along[0]])
    t, o = (points - points[0]) @ along, (points - points[0]) @ across
    trim = min(TRIM_MM, length / 5)
    middle = (t > trim) & (t < length - trim)
    base = np.where(known, 1.0, UNKNOWN_WEIGHT)[middle]
    for degree in DEGREES:
        curve = _robust_polynomial(t[middle], o[middle], base, degree)
        wave = gaussian_filter1d(np.clip(o[middle] - curve(t[middle]), -1.0, 1.0), WAVE_MM / spacing_mm, mode="nearest")
        if np.quantile(np.abs(wave), FIT_SHARE) < FIT_LIMIT_MM:
            return _Side(points[0], along, across, length, curve)
    return None


def _robust_polynomial(t: Array, o: Array, base: Array, degree: int) -> Polynomial:
    weight = base
    curve = Polynomial([0.0])
    for _ in range(8):
        curve = Polynomial.fit(t, o, degree, w=np.sqrt(weight))
        residual = o - curve(t)
        scale = max(0.05, 1.4826 * float(np.median(np.abs(residual))))
        weight = base * np.clip(1 - (residual / (4.0 * scale)) ** 2, 0, None) ** 2 + 1e-9
    return curve


def _piece(before: _Side | None, side: _Side | None, after: _Side | None, points: Array) -> Array:
    """Return one side's points of the polygon, from corner to corner."""
    if side is None:
        return points[1:-1]
    first = _meeting(before, side) if before is not None else side.end(False)[0]
    last = _meeting(side, after) if after is not None else side.end(True)[0]
    if side.straight:
        return np.stack([first, last])
    begin, end = (first - side.origin) @ side.along, (last - side.origin) @ side.along
    inner = side.at(np.linspace(begin, end, max(3, int((end - begin) / 2.0)))[1:-1])
    return np.concatenate([first[None], inner, last[None]])


def _meeting(a: _Side, b: _Side) -> Array:
    (p, u), (q, v) = a.end(True), b.end(False)
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) < 0.2:
        return np.asarray((p + q) / 2)
    reach = ((q[0] - p[0]) * v[1] - (q[1] - p[1]) * v[0]) / cross
    return np.asarray(p + reach * u)


def _without_repeats(loop: Array) -> Array:
    keep = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1) > 1e-6
    return np.asarray(loop[keep])
