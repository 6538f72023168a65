"""A robust smoothing spline over a height grid, with its own uncertainty.

Tensor cubic B-splines with a second-difference penalty (P-splines: Eilers and
Marx, Statistical Science 1996), fitted by iteratively reweighted least squares
with Tukey's biweight. On a grid the normal matrix is a handful of small matrix
products (array methods: Currie, Durban and Eilers, JRSS B 2006) and banded, so
one fit takes milliseconds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter

from eddyscan.core.frames import Array

DEGREE = 3


@dataclass(frozen=True)
class SplineBasis:
    """Uniform cubic B-splines over [low, high] with `intervals` knots intervals."""

    low: float
    high: float
    intervals: int

    @property
    def size(self) -> int:
        """Number of basis functions."""
        return self.intervals + DEGREE

    def matrix(self, x: Array, derivative: int = 0) -> Array:
        """Return the (N, size) values (or derivatives) at x, clamped to the interval."""
        step = (self.high - self.low) / self.intervals
        knots = self.low + step * np.arange(-DEGREE, self.intervals + DEGREE + 1)
        inside = np.clip(x, knots[DEGREE], knots[-DEGREE - 1])
        if derivative == 0:
            return np.asarray(BSpline.design_matrix(inside, knots, DEGREE).toarray())
        columns = [
            BSpline(knots, np.eye(self.size)[k], DEGREE).derivative(derivative)(inside) for k in range(self.size)
        ]
        return np.stack(columns, axis=1)


@dataclass(frozen=True)
class HeightSpline:
    """z(x, y) = sum c_kl B_k(x) B_l(y).

    Attributes
    ----------
    coefficients : (kx, ky) [mm]
    basis_x, basis_y : SplineBasis
    """

    coefficients: Array
    basis_x: SplineBasis
    basis_y: SplineBasis

    def on_grid(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        """Return heights (or derivatives) on the grid x (nx,) times y (ny,)."""
        return np.asarray(self.basis_x.matrix(x, dx) @ self.coefficients @ self.basis_y.matrix(y, dy).T)

    def at(self, x: Array, y: Array, dx: int = 0, dy: int = 0) -> Array:
        """Return heights (or derivatives) at scattered points (N,)."""
        bx, by = self.basis_x.matrix(x, dx), self.basis_y.matrix(y, dy)
        return np.asarray(((bx @ self.coefficients) * by).sum(axis=1))


class GridFit:
    """Weighted penalised fits on one grid, sharing everything that does not change."""

    def __init__(self, x: Array, y: Array, basis_x: SplineBasis, basis_y: SplineBasis) -> None:
        self.basis_x, self.basis_y = basis_x, basis_y
        self.Bx, self.By = basis_x.matrix(x), basis_y.matrix(y)
        self._products_x = [_offset_products(self.Bx, d) for d in range(-DEGREE, DEGREE + 1)]
        self._products_y = [_offset_products(self.By, d) for d in range(-DEGREE, DEGREE + 1)]
        self.hold(uniform_weights(basis_x.size, basis_y.size))

    def hold(self, weights: PenaltyWeights) -> None:
        """Set how strongly each second difference is penalised from now on."""
        self._penalty = _penalty_bands(self.basis_x.size, self.basis_y.size, weights)

    def solve(self, weight: Array, height: Array, smoothing: float) -> tuple[Array, Array]:
        """Return coefficients (kx, ky) and the banded Cholesky factor of the normal matrix."""
        bands = self._normal_bands(weight)
        bands = bands + smoothing * self._penalty
        bands[-1] += 1e-9 * max(float(bands[-1].max()), 1e-12)
        factor = cholesky_banded(bands, lower=False, check_finite=False)
        right = (self.Bx.T @ (weight * height) @ self.By).ravel()
        c = cho_solve_banded((factor, False), right, check_finite=False)
        return np.asarray(c).reshape(self.basis_x.size, self.basis_y.size), np.asarray(factor)

    def _normal_bands(self, weight: Array) -> Array:
        """Return B'WB in the upper banded form of LAPACK, index = k * ky + l."""
        kx, ky = self.basis_x.size, self.basis_y.size
        width = DEGREE * ky + DEGREE
        bands = np.zeros((width + 1, kx * ky))
        for dx in range(DEGREE + 1):
            left = self._products_x[dx + DEGREE].T @ weight
            for dy in range(-DEGREE, DEGREE + 1):
                shift = dx * ky + dy
                if shift < 0:
                    continue
                block = np.zeros((kx, ky))  # entry (k, l): <B_k B_l, B_(k+dx) B_(l+dy)>
                value = left @ self._products_y[dy + DEGREE]
                rows, cols = slice(0, kx - dx), slice(max(0, -dy), ky - max(0, dy))
                block[rows, cols] = value[rows, cols]
                flat = block.ravel()
                bands[width - shift, shift:] += flat[: kx * ky - shift]  # narrow grids share bands
        return bands


def _offset_products(B: Array, d: int) -> Array:
    """Return columns B_k * B_(k+d); zero where k+d leaves the basis."""
    product = np.zeros_like(B)
    if d >= 0:
        product[:, : B.shape[1] - d] = B[:, : B.shape[1] - d] * B[:, d:]
    else:
        product[:, -d:] = B[:, -d:] * B[:, :d]
    return product


@dataclass(frozen=True)
class PenaltyWeights:
    """How strongly each second difference is held: along x (kx-2, ky), y (kx, ky-2) and mixed (kx-1, ky-1)."""

    along_x: Array
    along_y: Array
    mixed: Array


def uniform_weights(kx: int, ky: int) -> PenaltyWeights:
    """Return the weights of the plain P-spline: the mixed difference counts twice, as in a thin plate."""
    return PenaltyWeights(np.ones((kx - 2, ky)), np.ones((kx, ky - 2)), np.full((kx - 1, ky - 1), 2.0))


def adaptive_weights(coefficients: Array) -> PenaltyWeights:
    """Return weights that let the surface bend where it already does.

    Each second difference is weighted by the inverse of its own local size, so
    that the penalty acts like the absolute value of the curvature: a boss keeps
    its flanks while the plain around it stays smooth.
    """
    sizes = [np.abs(np.diff(coefficients, 2, axis=0)), np.abs(np.diff(coefficients, 2, axis=1))]
    sizes.append(np.abs(np.diff(np.diff(coefficients, axis=0), axis=1)))
    local = [uniform_filter(s, 3, mode="nearest") for s in sizes]
    typical = max(float(np.median(np.concatenate([s.ravel() for s in local]))), 1e-6)
    held = [np.clip(1.5 * typical / (s + 0.5 * typical), 0.01, 3.0) for s in local]
    return PenaltyWeights(held[0], held[1], 2.0 * held[2])


def _penalty_bands(kx: int, ky: int, weights: PenaltyWeights) -> Array:
    """Return sum w (difference)^2 in upper banded form."""
    bands = np.zeros((DEGREE * ky + DEGREE + 1, kx * ky))
    second = ((0, 1.0), (1, -2.0), (2, 1.0))
    stencils = (
        (weights.along_x, [(k, 0, c) for k, c in second]),
        (weights.along_y, [(0, k, c) for k, c in second]),
        (weights.mixed, [(0, 0, 1.0), (1, 0, -1.0), (0, 1, -1.0), (1, 1, 1.0)]),
    )
    for weight, stencil in stencils:
        nx, ny = weight.shape
        for ax, ay, a in stencil:
            for bx, by, b in stencil:
                shift = (bx - ax) * ky + (by - ay)
                if shift < 0:
                    continue
                row = bands[len(bands) - 1 - shift].reshape(kx, ky)
                row[bx : bx + nx, by : by + ny] += a * b * weight
    return bands


def pointwise_variance(factor: Array, fit: GridFit, x: Array, y: Array) -> Array:
    """Return diag(B H^-1 B') on a coarse grid x (nx,) times y (ny,)."""
    Bx, By = fit.basis_x.matrix(x), fit.basis_y.matrix(y)
    rows = np.einsum("ik,jl->ijkl", Bx, By).reshape(len(x) * len(y), -1)
    solved = cho_solve_banded((factor, False), rows.T, check_finite=False)
    return np.asarray((rows * np.asarray(solved).T).sum(axis=1).reshape(len(x), len(y)))
