"""What a slot's expansion offers to the solver."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from eddyscan.core.frames import Array, BoolArray, ComplexArray
from eddyscan.physics.metal import DepthProfile, SlottedMetal


class SlotBasis(Protocol):
    """Functions on a slot of half length c and depth d that vanish like a square root at its buried edges."""

    @property
    def half_length_m(self) -> float:
        """Half the slot's length [m]."""

    @property
    def depth_m(self) -> float:
        """Greatest depth [m]."""

    @property
    def size(self) -> int:
        """Number of unknowns."""

    @property
    def odd(self) -> BoolArray:
        """Which functions are odd along the slot (size,)."""

    @property
    def highest_order(self) -> int:
        """Highest order along the slot."""

    def matrix(self, metal: SlottedMetal) -> ComplexArray:
        """Return the symmetric Galerkin matrix (size, size) of the sheet's own field."""

    def field_nodes(self, count: int) -> Array:
        """Return places x (count,) [m] where a coil's field is sampled."""

    def depth_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return what a depth profile contributes to each column (K, C)."""

    def fold(self, samples: ComplexArray) -> ComplexArray:
        """Return Galerkin integrals (P, H, size) of samples (P, count, H, C): places along x, columns in depth."""

    def line_columns(self, profile: DepthProfile) -> ComplexArray:
        """Return what a depth profile contributes to each quadrature column of the along-slot field (K, Q)."""

    def line_fold(self, samples: ComplexArray) -> ComplexArray:
        """Return samples (P, count, H, Q) times sqrt(dS) (P, H, ...), so that a sum of squares is an integral."""


def chebyshev_nodes(half_length_m: float, count: int) -> Array:
    """Return Chebyshev points of the second kind (count,) [m] on the slot's length."""
    return np.asarray(half_length_m * np.cos(np.arange(1, count + 1) * np.pi / (count + 1)))


def fejer_weights(half_length_m: float, count: int) -> Array:
    """Return the weights (count,) [m] of Fejer's second rule at these points."""
    angle = np.arange(1, count + 1) * np.pi / (count + 1)
    odd = np.arange(1, count + 1, 2)
    total = np.sin(np.outer(angle, odd)) @ (1.0 / odd)
    return np.asarray(half_length_m * 4 * np.sin(angle) / (count + 1) * total)
