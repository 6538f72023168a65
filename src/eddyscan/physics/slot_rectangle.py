"""Expansion of the dipole sheet on a rectangular slot.

Basis sqrt(1 - (x/c)^2) U_m(x/c) sqrt(1 - (z/d)^2) U_2n(z/d): the right behaviour
at the slot's edges, even about the surface. Its Fourier transforms are Bessel
functions, pi c (m+1) (-j)^m J_(m+1)(u c)/(u c).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from eddyscan.core.frames import Array, BoolArray, ComplexArray, IntArray
from eddyscan.physics.bessel_rules import ProductRule, product_rule
from eddyscan.physics.metal import DepthProfile, SlottedMetal
from eddyscan.physics.quadrature import gauss_panels
from eddyscan.physics.slot_basis import chebyshev_nodes, fejer_weights

LINE_DEPTHS = 8
KAPPA_NODES = 600


@dataclass(frozen=True)
class RectangleBasis:
    """`along` x `down` functions on a slot of half length c and depth d [m]; index m * down + n."""

    half_length_m: float
    depth_m: float
    along: int
    down: int

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.along * self.down

    def matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the symmetric Galerkin matrix (size, size) of the sheet's own field."""
        return self.plane_matrix(metal) + self.surface_matrix(metal)

    def plane_matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the part of the slot doubled by its mirror image (size, size)."""
        x_rule, px, z_rule, pz = self._rules(metal)
        u, w = x_rule.nodes / self.half_length_m, z_rule.nodes / self.depth_m
        plane = px @ metal.plane_kernel(u[:, None] ** 2 + w**2) @ pz.T / (2 * np.pi**2)
        return self._assemble(plane, x_rule.pairs, z_rule.pairs)

    def surface_matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the rest, of rank one in depth at each wave number (size, size)."""
        x_rule, px, z_rule, _ = self._rules(metal)
        shortest = min(self.half_length_m, self.depth_m, metal.skin_m)
        u = x_rule.nodes / self.half_length_m
        keep = u < 400 / shortest
        u, px, z_pairs = u[keep], px[:, keep], z_rule.pairs
        lowest = self._scales(metal)[0]
        edges = lowest * 3.0 ** np.arange(np.log(1e3 / shortest / lowest) / np.log(3))
        v, wv = gauss_panels(np.concatenate([[0.0], edges]), 7)
        folded = self._depth_products(metal, u, v, wv)
        total = px @ folded[:, z_pairs[:, 0], z_pairs[:, 1]]
        return self._assemble(total / np.pi**2, x_rule.pairs, z_pairs)

    def _depth_products(self, metal: SlottedMetal, u: Array, v: Array, wv: Array) -> ComplexArray:
        """Return the integral over v of products of depth transforms, summed over profiles (U, down, down).

        Transforms depend on kappa alone: they are computed on a fine logarithmic grid and splined.
        """
        uu, vv = np.meshgrid(u, v, indexing="ij")
        kappa = np.hypot(uu, vv)
        nodes = np.geomspace(kappa.min() * (1 - 1e-9), kappa.max() * (1 + 1e-9), KAPPA_NODES)
        total = np.zeros((len(u), self.down, self.down), dtype=np.complex128)
        for weight, profile in zip(metal.weights(uu, vv), metal.profiles(nodes), strict=True):
            depth = CubicSpline(np.log(nodes), self.depth_transform(profile))(np.log(kappa))
            total += np.matmul((depth * (weight * wv)[..., None]).transpose(0, 2, 1), depth)
        return total

    def _scales(self, metal: SlottedMetal) -> tuple[float, float]:
        """Return the smallest and largest wave numbers [1/m] that matter."""
        c, d = self.half_length_m, self.depth_m
        scales = [c, d, metal.skin_m, max(metal.opening_m, 0.02 * min(c, d, metal.skin_m))]
        if metal.layer.thickness_m is not None:
            scales.append(metal.layer.thickness_m)
        return 0.02 / max(scales), 20.0 / min(scales)

    def _rules(self, metal: SlottedMetal) -> tuple[ProductRule, Array, ProductRule, Array]:
        smallest, largest = self._scales(metal)
        x_orders, z_orders = np.arange(1, self.along + 1), 2 * np.arange(self.down) + 1
        c, d = self.half_length_m, self.depth_m
        x_rule = product_rule(x_orders, smallest=smallest * c, largest=largest * c)
        z_rule = product_rule(z_orders, smallest=smallest * d, largest=largest * d)
        px = x_rule.products * (_signs(x_orders, x_rule.pairs) * np.pi**2 * c)[:, None]
        pz = z_rule.products * (_signs(z_orders, z_rule.pairs) * np.pi**2 * d)[:, None]
        return x_rule, px, z_rule, pz

    def _assemble(self, values: ComplexArray, x_pairs: IntArray, z_pairs: IntArray) -> ComplexArray:
        full = np.zeros((self.along, self.down, self.along, self.down), dtype=np.complex128)
        (a, b), (p, q) = x_pairs.T, z_pairs.T
        for i, j in ((a, b), (b, a)):
            for k, m in ((p, q), (q, p)):
                full[i[:, None], k, j[:, None], m] = values
        return full.reshape(self.size, self.size)

    def depth_transform(self, profile: DepthProfile) -> ComplexArray:
        """Return the integral of each depth function times the profile (K, down) [m]."""
        theta, weight = depth_angles(self.down)
        z = -self.depth_m * np.cos(theta)
        functions = np.sin(np.outer(2 * np.arange(self.down) + 1, theta)) * np.sin(theta) * weight * self.depth_m
        return np.asarray(profile.values(z) @ functions.T)

    @property
    def odd(self) -> BoolArray:
        """Which functions are odd along the slot (size,)."""
        return np.repeat(np.arange(self.along) % 2 == 1, self.down)

    @property
    def highest_order(self) -> int:
        """Highest order along the slot."""
        return self.along

    def field_nodes(self, count: int) -> Array:
        """Return places x (count,) [m] along the slot where a coil's field is sampled."""
        return chebyshev_nodes(self.half_length_m, count)

    def line_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return the profile at quadrature depths, times the square root of their weights (K, Q)."""
        t, weight = gauss_panels(np.array([0.0, 1.0]), LINE_DEPTHS)
        return np.asarray(profile.values(-self.depth_m * t) * np.sqrt(self.depth_m * weight))

    def line_fold(self, samples: ComplexArray) -> ComplexArray:
        """Return samples (P, count, H, Q) times the square root of the area they stand for (P, H, count * Q)."""
        places, count, heights, _ = samples.shape
        weighted = samples * np.sqrt(fejer_weights(self.half_length_m, count))[:, None, None]
        return np.asarray(weighted.transpose(0, 2, 1, 3)).reshape(places, heights, -1)

    def depth_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return what a depth profile contributes to each column (K, down)."""
        return self.depth_transform(profile)

    def fold(self, samples: ComplexArray) -> ComplexArray:
        """Return Galerkin integrals (P, H, size) of samples (P, count, H, down)."""
        places, count, heights, columns = samples.shape
        angle = np.arange(1, count + 1) * np.pi / (count + 1)
        along = np.sin(np.outer(np.arange(1, self.along + 1), angle)) * np.sin(angle)
        along *= self.half_length_m * np.pi / (count + 1)
        # one real product: many small ones, or a complex one, cost several times as much
        flat = np.ascontiguousarray(samples.transpose(1, 0, 2, 3)).reshape(count, -1).view(np.float64)
        values = (along @ flat).view(np.complex128).reshape(self.along, places, heights, columns)
        return np.asarray(values.transpose(1, 2, 0, 3)).reshape(places, heights, self.size)


def _signs(orders: IntArray, pairs: IntArray) -> Array:
    a, b = orders[pairs[:, 0]], orders[pairs[:, 1]]
    return np.asarray(a * b * (-1.0) ** ((a - b) // 2))


@lru_cache(maxsize=16)
def depth_angles(down: int) -> tuple[Array, Array]:
    """Return nodes and weights in z = -d cos(theta), graded towards the surface (theta = pi/2)."""
    near = np.array([0.0, 0.003, 0.01, 0.03, 0.08, 0.18, 0.38])
    rest = np.linspace(0.38, np.pi / 2, 2 + int(0.25 * (2 * down + 2)))[1:]
    return gauss_panels(np.pi / 2 - np.concatenate([near, rest])[::-1], 8)
