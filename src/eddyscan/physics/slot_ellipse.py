"""Expansion of the dipole sheet on a semi-elliptic slot.

On the unit disc (xi = x/c, zeta = z/d) the functions
sqrt(1 - rho^2) rho^m P_k^(m, 1/2)(1 - 2 rho^2) cos(m theta), theta from x, vanish
like a square root at the buried edge and are even about the surface. Their
Fourier transforms are spherical Bessel functions,
2 pi (-j)^m cos(m alpha) s_k j_(m+2k+1)(q)/q with s_k = 2 Gamma(k + 3/2) / (sqrt(pi) k!)
(the Hankel transform of disc polynomials; Bateman, Tables of Integral Transforms II, 8.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import eval_jacobi, gammaln

from eddyscan.core.frames import Array, BoolArray, ComplexArray, IntArray
from eddyscan.physics.bessel_rules import product_rule
from eddyscan.physics.metal import DepthProfile, SlottedMetal
from eddyscan.physics.quadrature import gauss_panels
from eddyscan.physics.slot_basis import chebyshev_nodes, fejer_weights

HIGHEST_LINE_PHASE = 120.0
DEPTH_NODES = 28


@dataclass(frozen=True)
class EllipseBasis:
    """All functions with m + 2k <= degree on a half ellipse of half axes c (along x) and d (depth) [m]."""

    half_length_m: float
    depth_m: float
    degree: int

    @property
    def orders(self) -> tuple[IntArray, IntArray]:
        """Orders m and k (size,), (size,)."""
        pairs = [(m, k) for m in range(self.degree + 1) for k in range((self.degree - m) // 2 + 1)]
        m, k = np.array(pairs).T
        return m, k

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.orders[0])

    @property
    def odd(self) -> BoolArray:
        """Which functions are odd along the slot (size,)."""
        return np.asarray(self.orders[0] % 2 == 1)

    @property
    def highest_order(self) -> int:
        """Highest order along the slot."""
        return self.degree

    def matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the symmetric Galerkin matrix (size, size) of the sheet's own field."""
        return self.plane_matrix(metal) + self.surface_matrix(metal)

    def plane_matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the part of the slot doubled by its mirror image (size, size)."""
        c, d = self.half_length_m, self.depth_m
        m, k = self.orders
        bessel, index = np.unique(m + 2 * k + 1, return_inverse=True)
        small, large = sorted((c, d))
        gap = max(metal.opening_m, 0.02 * min(small, metal.skin_m))
        rule = product_rule(
            bessel,
            smallest=0.02 * small / max(large, metal.skin_m, gap),
            largest=20 * large / min(small, metal.skin_m, gap),
            spherical=True,
            same_parity=True,
        )
        alpha, wa = _angles(d / c)
        square = rule.nodes[:, None] ** 2 * ((np.cos(alpha) / c) ** 2 + (np.sin(alpha) / d) ** 2)
        kernel = metal.plane_kernel(square) * rule.nodes[:, None] * wa
        position = np.full((len(bessel), len(bessel)), -1)
        position[rule.pairs[:, 0], rule.pairs[:, 1]] = position[rule.pairs[:, 1], rule.pairs[:, 0]] = np.arange(
            len(rule.pairs)
        )
        strength = np.exp(gammaln(k + 1.5) - gammaln(k + 1.0)) * 2 / np.sqrt(np.pi)
        result = np.zeros((self.size, self.size), dtype=np.complex128)
        angular = np.cos(np.outer(np.arange(self.degree + 1), alpha))
        for a in range(self.degree + 1):
            for b in range(a % 2, a + 1, 2):
                radial = rule.products @ (kernel @ (angular[a] * angular[b]))
                rows, columns = np.flatnonzero(m == a), np.flatnonzero(m == b)
                block = radial[position[np.ix_(index[rows], index[columns])]]
                block = block * np.outer(strength[rows], strength[columns]) * (-1.0) ** ((a - b) // 2)
                result[np.ix_(rows, columns)] = block
                result[np.ix_(columns, rows)] = block.T
        return 2 * c * d * result

    def surface_matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the rest, of rank one in depth at each wave number (size, size)."""
        c, d = self.half_length_m, self.depth_m
        shortest = min(c, d, metal.skin_m)
        lowest = 0.02 / max(c, d, metal.skin_m, metal.layer.thickness_m or 0.0)
        edges = lowest * 2.0 ** np.arange(np.log2(80 / shortest / lowest) + 1)
        kappa, wk = gauss_panels(np.concatenate([[0.0], edges]), 7)
        x, z, weighted = self._area_rule(24 + self.degree + int(0.6 * HIGHEST_LINE_PHASE))
        odd = self.odd
        total = np.zeros((self.size, self.size), dtype=np.complex128)
        for one, share in zip(kappa, wk, strict=True):
            phi, wphi = _directions(one * c)
            u, v = one * np.sin(phi), one * np.cos(phi)
            phase = np.outer(x, u)
            for strength, profile in zip(metal.weights(u, v), metal.profiles(np.array([one])), strict=True):
                depth = profile.values(z.ravel())[0].reshape(z.shape)
                columns = np.einsum("bij,ij->bi", weighted, depth)
                lines = np.where(odd[:, None], columns @ np.sin(phase), columns @ np.cos(phase))
                total += (lines * (strength * share * one * wphi)) @ lines.T
        same = odd[:, None] == odd
        return np.asarray(np.where(same, total, 0) / np.pi**2)

    def _area_rule(self, count: int) -> tuple[Array, Array, Array]:
        """Return x (I,), z (I, J) [m] and basis times dS (size, I, J), graded towards the surface."""
        theta, wt = gauss_panels(np.linspace(0, np.pi, 2 + count // 16), 16)
        beta, wb = gauss_panels(np.array([0.0, 0.008, 0.03, 0.1, 0.3, 0.8, np.pi / 2]), 8)
        xi, height = np.cos(theta), np.sin(theta)
        zeta = -np.outer(height, np.sin(beta))
        area = np.outer(wt * height**2, wb * np.cos(beta)) * self.half_length_m * self.depth_m
        values = self.functions(xi[:, None], zeta) * area
        return self.half_length_m * xi, self.depth_m * zeta, values

    def functions(self, xi: Array, zeta: Array) -> Array:
        """Return the basis (size, ...) at points of the unit disc (...)."""
        xi, zeta = np.broadcast_arrays(xi, zeta)
        square = np.minimum(xi**2 + zeta**2, 1.0)
        m, k = self.orders
        power = (xi + 1j * zeta) ** np.arange(self.degree + 1).reshape(-1, *[1] * xi.ndim)
        edge = np.sqrt(1 - square)
        rows = [edge * power[a].real * eval_jacobi(b, a, 0.5, 1 - 2 * square) for a, b in zip(m, k, strict=True)]
        return np.asarray(rows)

    def field_nodes(self, count: int) -> Array:
        """Return places x (count,) [m] along the slot where a coil's field is sampled."""
        return chebyshev_nodes(self.half_length_m, count)

    def depth_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return the profile at the depth nodes (K, C)."""
        return profile.values(-self.depth_m * _depth_nodes())

    def line_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return the profile at the depth nodes (K, C)."""
        return self.depth_columns(profile)

    def fold(self, samples: ComplexArray) -> ComplexArray:
        """Return Galerkin integrals (P, H, size) of samples (P, count, H, C)."""
        places, count, heights, columns = samples.shape
        weights = self._weights(count).reshape(self.size, -1).T
        flat = np.asarray(samples.transpose(0, 2, 1, 3)).reshape(-1, count * columns)
        values = flat.real @ weights + 1j * (flat.imag @ weights)
        return np.asarray(values.reshape(places, heights, self.size))

    def _weights(self, count: int) -> Array:
        xi = chebyshev_nodes(1.0, count)
        height = np.sqrt(1 - xi**2)
        beta, wb = gauss_panels(np.array([0.0, 0.3, np.pi / 2]), 10 + self.degree // 2)
        zeta = -np.outer(height, np.sin(beta))
        area = np.outer(fejer_weights(self.half_length_m, count) * height, wb * np.cos(beta)) * self.depth_m
        values = self.functions(xi[:, None], zeta) * area
        return np.asarray(np.einsum("bij,ijc->bic", values, _interpolation(-zeta)))

    def line_fold(self, samples: ComplexArray) -> ComplexArray:
        """Return samples (P, count, H, C) times sqrt(dS) on the half ellipse (P, H, Q)."""
        places, count, heights, _ = samples.shape
        height = np.sqrt(1 - chebyshev_nodes(1.0, count) ** 2)
        t, wt = gauss_panels(np.array([0.0, 1.0]), 8)
        area = np.outer(fejer_weights(self.half_length_m, count) * height, wt) * self.depth_m
        local = _interpolation(np.outer(height, t)) * np.sqrt(area)[..., None]
        values = np.einsum("pihc,iqc->phiq", samples, local, optimize=True)
        return np.asarray(values.reshape(places, heights, -1))


@lru_cache(maxsize=1)
def _depth_nodes() -> Array:
    """Return relative depths (C,) in [0, 1], Chebyshev points of the first kind."""
    return np.asarray(0.5 - 0.5 * np.cos((np.arange(DEPTH_NODES) + 0.5) * np.pi / DEPTH_NODES))


def _interpolation(depth: Array) -> Array:
    """Return the Lagrange weights (..., C) that carry values at the depth nodes to relative depths (...)."""
    angle = (np.arange(DEPTH_NODES) + 0.5) * np.pi / DEPTH_NODES
    order = np.arange(DEPTH_NODES)
    at = np.arccos(np.clip(1 - 2 * depth, -1, 1))[..., None] * order
    scale = np.where(order == 0, 1.0, 2.0) / DEPTH_NODES
    return np.asarray((np.cos(at) * scale) @ np.cos(np.outer(order, angle)))


def _directions(phase: float) -> tuple[Array, Array]:
    """Return angles from the y axis and weights, fine enough for cos(phase sin(phi)), to the highest phase kept."""
    last = np.arcsin(min(1.0, HIGHEST_LINE_PHASE / max(phase, 1e-300)))
    return gauss_panels(np.linspace(0, last, 3 + int(phase * last / 4)), 8)


def _angles(aspect: float) -> tuple[Array, Array]:
    """Return angles in [0, pi/2] and weights, graded towards both ends for a flat or a steep ellipse."""
    finest = 0.3 * min(aspect, 1 / aspect, 1.0)
    steps = finest * 2.0 ** np.arange(int(np.log2(0.7 / finest)) + 1)
    near = np.concatenate([[0.0], steps])
    return gauss_panels(np.concatenate([near, [np.pi / 4], (np.pi / 2 - near)[::-1]]), 10)
