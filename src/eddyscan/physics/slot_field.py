"""A coil's field on the slot's plane, sampled and folded onto the slot's functions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import j1

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics.coil import Coil, source, wave_numbers
from eddyscan.physics.metal import DepthProfile, SlottedMetal
from eddyscan.physics.quadrature import gauss_panels
from eddyscan.physics.slot_basis import SlotBasis

SAMPLES_PER_CHUNK = 1_500_000


@dataclass(frozen=True)
class Drive:
    """A coil's field per ampere on the slot, for P positions and H lift-offs.

    Attributes
    ----------
    across : (P, H, size) complex128
        Galerkin integrals of E_y [V/A, basis units].
    along : (P, H, Q) complex128
        sqrt(sigma a dS) E_x at the slot's quadrature points.
    """

    across: ComplexArray
    along: ComplexArray


class CoilOnSlot:
    """Folds the field of one coil onto one slot's basis, for any positions within `reach_m` and given lift-offs.

    The field in the metal is azimuthal (Dodd and Deeds 1968):
    E_phi(r, z) = -j omega mu0 i I integral of M(k) exp(-k h) (1 + Gamma)/2 f(z) J1(k r) dk.
    """

    def __init__(self, coil: Coil, metal: SlottedMetal, basis: SlotBasis, *, reach_m: float, lift_off_m: Array) -> None:
        self.basis = basis
        k, w = wave_numbers(coil, reach_m=reach_m, finest_m=float(lift_off_m.min()))
        strength = np.abs(w * source(coil, k) * np.exp(-k * lift_off_m.min()))
        keep = k <= k[strength > 1e-9 * strength.max()].max()
        self.k, w = k[keep], w[keep]
        detail = self.k[strength[keep] > 1e-6 * strength.max()].max()
        self.count = int(max(2 * basis.highest_order + 12, 24 + 0.9 * detail * basis.half_length_m))
        self.count = min(self.count, 400)
        amplitude = -metal.j_omega_mu * coil.turn_density * w * source(coil, self.k)
        self.scale = amplitude * np.exp(-np.outer(lift_off_m, self.k))
        profile = metal.coil_profile(self.k)
        self._fold = basis.folding(profile, self.count, self.scale)
        self._nodes = basis.field_nodes(self.count)
        self._along = self._along_weights(metal, profile)

    def _along_weights(self, metal: SlottedMetal, profile: DepthProfile) -> list[ComplexArray] | None:
        if metal.opening_m == 0:
            return None
        t, wt = gauss_panels(np.array([0.0, 0.25, 1.0]), 6)
        weights = self.basis.line_weights(self.count)
        found = []
        for node, weight in zip(self._nodes, weights, strict=True):
            depth = self.basis.local_depth(node)
            size = np.sqrt(metal.sigma * metal.opening_m * weight * depth * wt)
            values = profile.values(-depth * t) * size
            found.append(np.einsum("hk,kq->khq", self.scale, values).reshape(len(self.k), -1))
        return found

    def drives(self, x_m: Array, y_m: Array) -> Iterator[tuple[slice, Drive]]:
        """Yield (which positions, their Drive) in chunks for coil axes at x, y (N,), (N,) [m, slot frame]."""
        step = max(1, SAMPLES_PER_CHUNK // (self.count * len(self.k)))
        for start in range(0, len(x_m), step):
            part = slice(start, min(start + step, len(x_m)))
            dx = self._nodes - x_m[part, None]
            dy = np.broadcast_to(y_m[part, None], dx.shape)
            r = np.hypot(dx, dy)
            bessel = j1(r[..., None] * self.k) / np.maximum(r, 1e-12)[..., None]
            across = self._fold(bessel * dx[..., None])
            yield part, Drive(across, self._along_values(bessel * dy[..., None]))

    def _along_values(self, samples: Array) -> ComplexArray:
        heights = len(self.scale)
        if self._along is None or not samples.any():
            return np.zeros((len(samples), heights, 1), dtype=np.complex128)
        parts = [samples[:, i] @ weights for i, weights in enumerate(self._along)]
        shaped = [part.reshape(len(samples), heights, -1) for part in parts]
        return np.concatenate(shaped, axis=2)
