"""The true spot below the coil: closest point of the exact surface, fast enough for every reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array
from eddyscan.core.parts import Hemisphere, NominalPart

GRID_MM = 4.0
NEWTON_STEPS = 8
STENCIL = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]], dtype=float)


First = tuple[Array, Array]
Second = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Foot:
    """Where the coil is over the surface.

    Attributes
    ----------
    point_mm : (3,) closest point [mm, part]
    normal : (3,) unit outward normal there
    distance_mm : float
        Along the normal, negative inside the metal; beyond the outline the
        plain distance to the rim.
    curvature_per_mm : float
        Sum of the principal curvatures, positive where the surface bulges out.
    edge_mm : float
        Distance of the spot to the outline; negative beyond it.
    """

    point_mm: Array
    normal: Array
    distance_mm: float
    curvature_per_mm: float
    edge_mm: float


class FootFinder:
    """Newton on the surface's parameters from the nearest of a coarse grid."""

    def __init__(self, part: NominalPart) -> None:
        self._part = part
        U, V = part.grid(GRID_MM)
        self._u, self._v = U.ravel(), V.ravel()
        self._tree = KDTree(part.surface(self._u, self._v))
        self._low = np.array([part.u_range[0], part.v_range[0]])
        self._high = np.array([part.u_range[1], part.v_range[1]])
        self._step = 1e-4 * (self._high - self._low)

    def at(self, point_mm: Array) -> Foot:
        """Return the foot of a point (3,) [mm, part]."""
        if isinstance(self._part, Hemisphere):
            return _dome_foot(self._part, point_mm)
        start = int(self._tree.query(point_mm)[1])
        uv = np.array([self._u[start], self._v[start]])
        small = 1e-6 * (self._high - self._low)
        for _ in range(NEWTON_STEPS):
            S, S_u, S_v, second = self._local(uv)
            step = self._newton_step(uv, S - point_mm, (S_u, S_v), second)
            if (np.abs(step) <= small).all():
                break
            uv = uv + step
        S = S + step[0] * S_u + step[1] * S_v
        return self._foot(uv + step, point_mm, S, (S_u, S_v), second)

    def _newton_step(self, uv: Array, r: Array, first: First, second: Second) -> Array:
        """Return a step that lowers the distance |r| and stays inside the parameter rectangle."""
        S_u, S_v = first
        p, q = float(S_u @ r), float(S_v @ r)
        a, b, c = float(S_u @ S_u), float(S_u @ S_v), float(S_v @ S_v)
        fa, fb, fc = (m + float(d @ r) for m, d in zip((a, b, c), second, strict=True))
        if fa > 0 and fa * fc > fb * fb:
            a, b, c = fa, fb, fc
        stuck_u, stuck_v = self._stuck(0, uv, p), self._stuck(1, uv, q)
        if stuck_u or stuck_v:
            du, dv = (0.0 if stuck_u else -p / a), (0.0 if stuck_v else -q / c)
        else:
            du, dv = (b * q - c * p) / (a * c - b * b), (b * p - a * q) / (a * c - b * b)
        goal = (
            min(max(value + d, low), high)
            for value, d, low, high in zip(uv, (du, dv), self._low, self._high, strict=True)
        )
        return np.array(list(goal)) - uv

    def _stuck(self, k: int, uv: Array, gradient: float) -> bool:
        """Return whether parameter k is at a limit that the distance pulls it beyond."""
        return bool((uv[k] <= self._low[k] and gradient > 0) or (uv[k] >= self._high[k] and gradient < 0))

    def _local(self, uv: Array) -> tuple[Array, Array, Array, Second]:
        """Return S, S_u, S_v and (S_uu, S_uv, S_vv), each (3,), from one nine-point stencil."""
        at = uv + STENCIL * self._step
        P = self._part.surface(at[:, 0], at[:, 1])
        eu, ev = self._step
        S_uu = (P[1] + P[2] - 2 * P[0]) / eu**2
        S_uv = (P[5] + P[6] - P[7] - P[8]) / (4 * eu * ev)
        S_vv = (P[3] + P[4] - 2 * P[0]) / ev**2
        return P[0], (P[1] - P[2]) / (2 * eu), (P[3] - P[4]) / (2 * ev), (S_uu, S_uv, S_vv)

    def _foot(self, uv: Array, point_mm: Array, S: Array, first: First, second: Second) -> Foot:
        S_u, S_v = first
        n = np.cross(S_u, S_v)
        n = n / np.sqrt(n @ n)
        a, b, c = float(S_u @ S_u), float(S_u @ S_v), float(S_v @ S_v)
        L, M, N = (float(d @ n) for d in second)
        curvature = -(L * c - 2 * M * b + N * a) / (a * c - b * b)
        inside = float((np.minimum(uv - self._low, self._high - uv) * (a**0.5, c**0.5)).min())
        away = point_mm - S
        height = float(away @ n)
        sideways = float(np.linalg.norm(away - height * n))
        if inside <= 1e-6 and sideways > 1e-3:
            return Foot(S, n, float(np.linalg.norm(away)), curvature, -sideways)
        return Foot(S, n, height, curvature, inside)


def _dome_foot(dome: Hemisphere, point_mm: Array) -> Foot:
    foot, normal, height = dome.closest(np.array(point_mm, dtype=float)[None])
    R = dome.radius_mm
    rim = R * float(np.arcsin(np.clip(foot[0, 2] / R, 0.0, 1.0)))
    if point_mm[2] < 0:
        return Foot(foot[0], normal[0], float(np.linalg.norm(point_mm - foot[0])), 2 / R, float(point_mm[2]))
    return Foot(foot[0], normal[0], float(height[0]), 2 / R, rim)
