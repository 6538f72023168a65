"""The true spot below the coil: closest point of the exact surface, fast enough for every reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.parts import Hemisphere, NominalPart

GRID_MM = 4.0
STENCIL = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]], dtype=float)


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
        self._points = part.surface(self._u, self._v)
        self._low = np.array([part.u_range[0], part.v_range[0]])
        self._high = np.array([part.u_range[1], part.v_range[1]])
        self._step = 1e-4 * (self._high - self._low)

    def at(self, point_mm: Array) -> Foot:
        """Return the foot of a point (3,) [mm, part]."""
        if isinstance(self._part, Hemisphere):
            return _dome_foot(self._part, point_mm)
        start = int(((self._points - point_mm) ** 2).sum(axis=1).argmin())
        uv: Array = np.array([self._u[start], self._v[start]])
        for _ in range(6):
            S, J, H = self._local(uv)
            r = S - point_mm
            step = self._newton_step(uv, J.T @ r, J.T @ J + np.tensordot(H, r, axes=1), J.T @ J)
            uv += step
            if np.abs(step).max() < 1e-9 * np.abs(self._high - self._low).max():
                break
        return self._foot(uv, point_mm)

    def _newton_step(self, uv: Array, gradient: Array, hessian: Array, gauss: Array) -> Array:
        """Return a step that lowers the distance and stays inside the parameter rectangle."""
        at_limit = ((uv <= self._low) & (gradient > 0)) | ((uv >= self._high) & (gradient < 0))
        matrix = hessian if np.linalg.det(hessian) > 0 and hessian[0, 0] > 0 else gauss
        if at_limit.all():
            return np.zeros(2)
        if at_limit.any():
            free = int(np.flatnonzero(~at_limit)[0])
            step: Array = np.zeros(2)
            step[free] = -gradient[free] / max(matrix[free, free], 1e-12)
        else:
            step = np.asarray(-np.linalg.solve(matrix, gradient), dtype=np.float64)
        return np.asarray(np.clip(uv + step, self._low, self._high) - uv)

    def _local(self, uv: Array) -> tuple[Array, Array, Array]:
        """Return S (3,), J (3, 2) and second derivatives H (2, 2, 3) from one nine-point stencil."""
        at = uv + STENCIL * self._step
        P = self._part.surface(at[:, 0], at[:, 1])
        eu, ev = self._step
        J = np.stack([(P[1] - P[2]) / (2 * eu), (P[3] - P[4]) / (2 * ev)], axis=1)
        S_uv = (P[5] + P[6] - P[7] - P[8]) / (4 * eu * ev)
        H = np.array([[(P[1] + P[2] - 2 * P[0]) / eu**2, S_uv], [S_uv, (P[3] + P[4] - 2 * P[0]) / ev**2]])
        return P[0], J, H

    def _foot(self, uv: Array, point_mm: Array) -> Foot:
        S, J, H = self._local(uv)
        n = np.cross(J[:, 0], J[:, 1])
        n /= np.linalg.norm(n)
        first = J.T @ J
        curvature = -float(np.trace(np.linalg.solve(first, H @ n)))
        metric = np.sqrt(np.diag(first))
        inside = float((np.minimum(uv - self._low, self._high - uv) * metric).min())
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
