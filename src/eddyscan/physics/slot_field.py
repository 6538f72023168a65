"""A coil's field on the slot's plane, sampled and folded onto the slot's functions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.special import j1

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics.coil import Coil, source, wave_numbers
from eddyscan.physics.metal import SlottedMetal
from eddyscan.physics.slot_basis import SlotBasis

VALUES_PER_CHUNK = 1_000_000
RADII_PER_MEAN_RADIUS = 80


@dataclass(frozen=True)
class Drive:
    """A coil's field per ampere on the slot, for P positions and H lift-offs.

    Attributes
    ----------
    across : (P, H, size) complex128
        Galerkin integrals of E_y [V/A, basis units].
    along : (P, H, Q) complex128
        sqrt(sigma a dS) E_x at the slot's quadrature points; Q = 0 where it vanishes.
    """

    across: ComplexArray
    along: ComplexArray


class CoilOnSlot:
    """Folds the field of one coil onto one slot's basis, for any positions within `reach_m` and given lift-offs.

    The field in the metal is azimuthal (Dodd and Deeds 1968):
    E_phi(r, z) = -j omega mu0 i I integral of M(k) exp(-k h) (1 + Gamma)/2 f(z) J1(k r) dk.
    Its depth integrals are tabulated once over the radius r, as splines of E_phi / r.
    `samples` places along the slot are used at least: two coils that are to react
    need the same number.
    """

    def __init__(
        self,
        coil: Coil,
        metal: SlottedMetal,
        basis: SlotBasis,
        *,
        reach_m: float,
        lift_off_m: Array,
        samples: int = 0,
    ) -> None:
        self._basis = basis
        k, w = wave_numbers(coil, reach_m=reach_m, finest_m=float(lift_off_m.min()))
        strength = np.abs(source(coil, k)) * np.exp(-k * lift_off_m.min())
        keep = k <= k[strength > 1e-8 * strength.max()].max()
        k, w = k[keep], w[keep]
        detail = k[strength[keep] > 1e-3 * strength.max()].max()
        self.samples = max(samples, int(10 + 0.5 * basis.highest_order + 0.6 * detail * basis.half_length_m))
        self._nodes = basis.field_nodes(self.samples)
        profile = metal.coil_profile(k)
        amplitude = -metal.j_omega_mu * coil.turn_density * w * source(coil, k)
        scale = amplitude * np.exp(-np.outer(lift_off_m, k))
        self._heights = len(lift_off_m)
        radii = _radii(coil, reach_m)
        self._across = self._spline(radii, k, scale, basis.depth_columns(profile))
        self._along: BSpline | None = None
        if metal.opening_m > 0:
            columns = np.sqrt(metal.sigma * metal.opening_m) * basis.line_columns(profile)
            self._along = self._spline(radii, k, scale, columns)

    def _spline(self, radii: Array, k: Array, scale: ComplexArray, columns: ComplexArray) -> BSpline:
        right = np.einsum("hk,kc->khc", scale, columns).reshape(len(k), -1).view(np.float64)
        values = np.empty((len(radii), right.shape[1]))
        step = max(1, VALUES_PER_CHUNK * 4 // len(k))
        for start in range(0, len(radii), step):
            r = np.maximum(radii[start : start + step, None], 1e-9 * radii[1])
            values[start : start + step] = (j1(r * k) / r) @ right
        return make_interp_spline(radii, values.view(np.complex128), k=3)

    def drives(self, x_m: Array, y_m: Array) -> Iterator[tuple[slice, Drive]]:
        """Yield (which positions, their Drive) in chunks for coil axes at x, y (N,), (N,) [m, slot frame]."""
        columns = self._across.c.shape[1]
        step = max(1, VALUES_PER_CHUNK // (self.samples * columns))
        for start in range(0, len(x_m), step):
            part = slice(start, min(start + step, len(x_m)))
            dx = self._nodes - x_m[part, None]
            dy = np.broadcast_to(y_m[part, None], dx.shape)
            r = np.hypot(dx, dy)
            across = self._sampled(self._across, r)
            across *= dx[..., None, None]
            yield part, Drive(self._basis.fold(across), self._along_values(r, dy))

    def _sampled(self, spline: BSpline, r: Array) -> ComplexArray:
        rows = BSpline.design_matrix(r.ravel(), spline.t, 3)
        values = np.asarray(rows @ np.ascontiguousarray(spline.c).view(np.float64)).view(np.complex128)
        return values.reshape(*r.shape, self._heights, -1)

    def _along_values(self, r: Array, dy: Array) -> ComplexArray:
        if self._along is None or not dy.any():
            return np.zeros((len(r), self._heights, 0), dtype=np.complex128)
        return self._basis.line_fold(self._sampled(self._along, r) * dy[..., None, None])


def _radii(coil: Coil, reach_m: float) -> Array:
    """Return radii [m] from 0 to the reach: even spacing to four outer radii, growing by 2 % beyond."""
    spacing = coil.mean_radius_m / RADII_PER_MEAN_RADIUS
    near = min(reach_m, 4 * coil.outer_m) * (1 + 1e-9)
    even = np.linspace(0.0, near, 8 + int(near / spacing))
    if reach_m <= near:
        return even
    far = near * np.geomspace(1.0, reach_m / near * (1 + 1e-9), 3 + int(np.log(reach_m / near) / np.log(1.02)))
    return np.concatenate([even, far[1:]])
