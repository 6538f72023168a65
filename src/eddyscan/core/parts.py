"""Parts known by name: exact parametric surfaces standing on a flat bottom.

Every part is one smooth patch ``S(u, v)`` [mm, part frame] over a rectangle of
parameters, with closed sides down to z = 0. Shapes: the reference study's
blocks (table 2 of the study; `block-d` is its published code), a hemisphere,
a twisted cambered blade, a plate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh

BLOCK_SIZE_MM = (200.0, 100.0, 30.0)
BLADE_SIZE_MM = (200.0, 80.0)
BLADE_TWIST_DEG = 40.0
BLADE_CAMBER_MM = 8.0
BLADE_LIFT_MM = 20.0
DOME_RADIUS_MM = 50.0

Surface = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class NominalPart:
    """An exact part.

    Attributes
    ----------
    name : str
    surface : callable
        ``S(u, v)`` with u, v (...,) -> (..., 3) [mm, part frame].
    u_range, v_range : (2,) limits of the parameters
    """

    name: str
    surface: Surface
    u_range: tuple[float, float]
    v_range: tuple[float, float]

    def derivatives(self, u: Array, v: Array) -> tuple[Array, Array]:
        """Return S_u and S_v (..., 3) by central differences (error below 1e-8 relative)."""
        eu = 1e-5 * (self.u_range[1] - self.u_range[0])
        ev = 1e-5 * (self.v_range[1] - self.v_range[0])
        S_u = (self.surface(u + eu, v) - self.surface(u - eu, v)) / (2 * eu)
        S_v = (self.surface(u, v + ev) - self.surface(u, v - ev)) / (2 * ev)
        return S_u, S_v

    def normal(self, u: Array, v: Array) -> Array:
        """Return the unit outward normals (..., 3)."""
        S_u, S_v = self.derivatives(u, v)
        n = np.cross(S_u, S_v)
        return np.asarray(n / np.linalg.norm(n, axis=-1, keepdims=True))

    def grid(self, edge_mm: float) -> tuple[Array, Array]:
        """Return parameter grids (Nu, Nv) with surface steps of about `edge_mm`."""
        u = np.linspace(*self.u_range, 65)
        v = np.linspace(*self.v_range, 65)
        P = self.surface(*np.meshgrid(u, v, indexing="ij"))
        along_u = np.linalg.norm(np.diff(P, axis=0), axis=-1).sum(axis=0).max()
        along_v = np.linalg.norm(np.diff(P, axis=1), axis=-1).sum(axis=1).max()
        nu = max(2, int(np.ceil(along_u / edge_mm)) + 1)
        nv = max(2, int(np.ceil(along_v / edge_mm)) + 1)
        U, V = np.meshgrid(np.linspace(*self.u_range, nu), np.linspace(*self.v_range, nv), indexing="ij")
        return U, V

    def top_mesh(self, edge_mm: float = 1.0) -> SurfaceMesh:
        """Return the inspected surface alone as a mesh with exact vertices and normals."""
        U, V = self.grid(edge_mm)
        vertices = self.surface(U, V).reshape(-1, 3)
        return SurfaceMesh(vertices, _grid_faces(*U.shape), self.normal(U, V).reshape(-1, 3))

    def solid_mesh(self, edge_mm: float = 1.0) -> SurfaceMesh:
        """Return the whole part: the inspected surface, closed sides and the bottom."""
        U, V = self.grid(edge_mm)
        nu, nv = U.shape
        top = self.surface(U, V).reshape(-1, 3)
        index = np.arange(nu * nv).reshape(nu, nv)
        loop = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
        below = top[loop] * (1.0, 1.0, 0.0)
        centre = np.array([[*below[:, :2].mean(axis=0), 0.0]])
        low = len(top) + np.arange(len(loop))
        nxt = np.roll(np.arange(len(loop)), -1)
        sides = np.concatenate([np.stack([loop, low, low[nxt]], axis=1), np.stack([loop, low[nxt], loop[nxt]], axis=1)])
        bottom = np.stack([np.full(len(loop), len(top) + len(loop)), low[nxt], low], axis=1)
        faces = np.concatenate([_grid_faces(nu, nv), sides, bottom])
        return SurfaceMesh.from_triangles(np.concatenate([top, below, centre]), faces)

    def closest(self, points: Array, iterations: int = 12) -> tuple[Array, Array, Array]:
        """Return the closest points of the inspected surface.

        Parameters
        ----------
        points : (N, 3) [mm, part]

        Returns
        -------
        foot : (N, 3) [mm, part]; clamped to the surface's outline
        normal : (N, 3) unit outward normals at the feet
        distance_mm : (N,) signed along the normal, positive outside

        Notes
        -----
        Gauss-Newton on (u, v) from the nearest of a 2 mm grid, clamped to the
        parameter rectangle.
        """
        U, V = self.grid(2.0)
        tree = KDTree(self.surface(U, V).reshape(-1, 3))
        _, nearest = tree.query(points)
        u, v = U.ravel()[nearest], V.ravel()[nearest]
        for _ in range(iterations):
            residual = points - self.surface(u, v)
            S_u, S_v = self.derivatives(u, v)
            a, b, c = (S_u * S_u).sum(-1), (S_u * S_v).sum(-1), (S_v * S_v).sum(-1)
            p, q = (S_u * residual).sum(-1), (S_v * residual).sum(-1)
            determinant = np.maximum(a * c - b * b, 1e-30)
            u = np.clip(u + (c * p - b * q) / determinant, *self.u_range)
            v = np.clip(v + (a * q - b * p) / determinant, *self.v_range)
        foot, normal = self.surface(u, v), self.normal(u, v)
        return foot, normal, np.asarray(((points - foot) * normal).sum(-1))


@dataclass(frozen=True)
class Hemisphere(NominalPart):
    """A dome: its parameter map is singular at the square's corners, so normals and feet are analytic."""

    radius_mm: float = DOME_RADIUS_MM

    @property
    def _centre(self) -> Array:
        return np.array([self.radius_mm, self.radius_mm, 0.0])

    def normal(self, u: Array, v: Array) -> Array:
        """Return the unit outward normals (..., 3)."""
        return np.asarray((self.surface(u, v) - self._centre) / self.radius_mm)

    def closest(self, points: Array, iterations: int = 0) -> tuple[Array, Array, Array]:
        """Return feet, normals and signed distances; below the rim the foot is on the rim."""
        direction = points - self._centre
        direction[:, 2] = np.maximum(direction[:, 2], 0.0)
        normal = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
        foot = self._centre + self.radius_mm * normal
        return foot, normal, np.asarray(((points - foot) * normal).sum(-1))


def _grid_faces(nu: int, nv: int) -> IntArray:
    index = np.arange(nu * nv).reshape(nu, nv)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def _block(height: Callable[[Array], Array]) -> Surface:
    return lambda u, v: np.stack(np.broadcast_arrays(u, v, BLOCK_SIZE_MM[2] + height(u)), axis=-1).astype(float)


def _sine(wavelength_mm: float, amplitude_mm: float) -> Surface:
    return _block(lambda x: amplitude_mm * np.sin(2 * np.pi * x / wavelength_mm))


def _flat_margins(x: Array) -> Array:
    return np.asarray(np.where((x >= 25) & (x <= 175), 7.5 * np.sin(2 * np.pi * x / 100 - np.pi / 2), 0.0))


def _dome(u: Array, v: Array) -> Array:
    """Hemisphere as an equal-angle map of the square to the half sphere (no pole singularity).

    (u, v) in [-1, 1]^2 -> polar angle = 90 deg * max(|u|, |v|)-like radius of the
    square-to-disc map of Shirley and Chiu, smooth inside by the elliptical map
    x = u sqrt(1 - v^2/2), y = v sqrt(1 - u^2/2).
    """
    x, y = u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)
    r = np.sqrt(x * x + y * y)
    scale = np.sinc(r / 2) * np.pi / 2  # sin(r pi/2) / r
    return np.stack(
        [
            DOME_RADIUS_MM * (1 + x * scale),
            DOME_RADIUS_MM * (1 + y * scale),
            DOME_RADIUS_MM * np.cos(r * np.pi / 2),
        ],
        axis=-1,
    )


def _blade(u: Array, v: Array) -> Array:
    """Twisted, cambered sheet; area 16463.39 mm^2 as in the planning measurements."""
    half = BLADE_SIZE_MM[1] / 2
    angle = np.radians(BLADE_TWIST_DEG) * (u / BLADE_SIZE_MM[0] - 0.5)
    camber = BLADE_CAMBER_MM * (1 - (v / half) ** 2)
    y = half + v * np.cos(angle) - camber * np.sin(angle)
    z = BLADE_LIFT_MM + v * np.sin(angle) + camber * np.cos(angle)
    return np.stack(np.broadcast_arrays(u, y, z), axis=-1).astype(float)


_X, _Y = (0.0, BLOCK_SIZE_MM[0]), (0.0, BLOCK_SIZE_MM[1])

PARTS: dict[str, NominalPart] = {
    part.name: part
    for part in (
        NominalPart("block-a", _sine(150.0, 7.5), _X, _Y),
        NominalPart("block-b", _sine(150.0, 7.5), _X, _Y),
        NominalPart("block-c", _sine(140.0, 15.0), _X, _Y),
        NominalPart("block-d", _block(_flat_margins), _X, _Y),
        Hemisphere("dome", _dome, (-1.0, 1.0), (-1.0, 1.0)),
        NominalPart("blade", _blade, (0.0, BLADE_SIZE_MM[0]), (-BLADE_SIZE_MM[1] / 2, BLADE_SIZE_MM[1] / 2)),
        NominalPart("plate", _block(np.zeros_like), _X, _Y),
    )
}


def named_part(name: str) -> NominalPart:
    """Return the part called `name`, or raise InputError naming those there are."""
    try:
        return PARTS[name]
    except KeyError:
        raise InputError(f"there is no part called {name!r}; known are {', '.join(PARTS)}.") from None
