"""The slotted layer as its sheet of current dipoles sees it: wave numbers, reflections, kernels.

A slot forces the current around it. It acts as a sheet of current dipoles p
normal to its plane (J. R. Bowler, J. Appl. Phys. 75 (1994) 8128, for the ideal
crack); here the dipoles fill the opening a uniformly. In the spectral domain
(u, v along x, y; kappa^2 = u^2 + v^2; lambda^2 = kappa^2 + g, g = j omega mu0 sigma)
a y-dipole splits into a transverse-electric part (weight u^2/kappa^2) and a
transverse-magnetic part (weight v^2 lambda^2 / (kappa^2 g)), each on its own
transmission line along z with reflections at the surface, R_TE =
(lambda - kappa)/(lambda + kappa) and R_TM = +1, and at the layer's lower face:

    E_y = -j omega mu0 [ (u^2/kappa^2) G_TE + (v^2 lambda^2/(kappa^2 g)) G_TM ] p

The part with R = +1 in both is free space plus a mirror image: the slot doubled
to [-d, d] with p even. On the slot, averaged over the opening, its plane
spectrum is (u^2 + w^2) K(s) / sigma with s^2 = u^2 + w^2 + g and

    K(s) = (a s - 1 + exp(-a s)) / (a^2 s^3)  ->  1/(2 s) for a -> 0

after the delta term of the dyadic has cancelled the air-filled slot's own term
1/(sigma a). What remains of G is of rank one in exponentials of z: `profiles` and
`weights`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics.coil import MU0
from eddyscan.physics.conductor import Layer, layer_lambda, normal_admittance, surface_admittance


@dataclass(frozen=True)
class DepthProfile:
    """A sum of exponentials in z: up exp(lam z) + down exp(-lam (z + thickness)); arrays (K,)."""

    lam: ComplexArray
    up: ComplexArray
    down: ComplexArray | None
    thickness_m: float

    def values(self, z_m: Array) -> ComplexArray:
        """Return the profile at depths z <= 0 (Z,): (K, Z)."""
        total = self.up[:, None] * np.exp(np.outer(self.lam, z_m))
        if self.down is not None:
            total = total + self.down[:, None] * np.exp(-np.outer(self.lam, z_m + self.thickness_m))
        return np.asarray(total)


@dataclass(frozen=True)
class SlottedMetal:
    """The layer a slot breaks, the layers under it, and the frequency.

    Attributes
    ----------
    layer : Layer
        Non-magnetic metal.
    below : layers under it, air under the last
    frequency_hz : float
    opening_m : float
    """

    layer: Layer
    below: tuple[Layer, ...]
    frequency_hz: float
    opening_m: float

    @property
    def sigma(self) -> float:
        """Conductivity [S/m]."""
        return self.layer.conductivity_s_m

    @property
    def j_omega_mu(self) -> complex:
        """J omega mu0 [ohm/m]."""
        return 2j * np.pi * self.frequency_hz * MU0

    @property
    def skin_m(self) -> float:
        """Standard depth of penetration [m]."""
        return float(np.sqrt(2 / (abs(self.j_omega_mu) * self.sigma)))

    def plane_kernel(self, square: Array) -> ComplexArray:
        """Return (u^2 + w^2) K(s) / sigma for `square` = u^2 + w^2 [1/m^2]."""
        s = np.sqrt(square + self.j_omega_mu * self.sigma)
        x = self.opening_m * s
        with np.errstate(invalid="ignore", divide="ignore"):
            exact = (x - 1 + np.exp(-x)) / (x * x)
        series = 0.5 - x / 6 + x**2 / 24 - x**3 / 120 + x**4 / 720
        return np.asarray(square * np.where(np.abs(x) < 0.02, series, exact) / (s * self.sigma))

    def lower_face(self, kappa: Array) -> tuple[ComplexArray, ComplexArray] | None:
        """Return R_TE and R_TM (K,) at the layer's lower face, None for a half-space."""
        if self.layer.thickness_m is None:
            return None
        lam = layer_lambda(self.layer, kappa, self.frequency_hz)
        admittance = surface_admittance(self.below, kappa, self.frequency_hz)
        own, under = self.sigma / lam, normal_admittance(self.below, kappa, self.frequency_hz)
        return (lam - admittance) / (lam + admittance), (own - under) / (own + under)

    def profiles(self, kappa: Array) -> list[DepthProfile]:
        """Return the depth profiles of the rank-one rest of G at wave numbers kappa (K,) [1/m].

        One for a half-space; for a layer two more, transverse electric and magnetic,
        for what its lower face sends back.
        """
        lam = layer_lambda(self.layer, kappa, self.frequency_hz)
        one = np.ones_like(lam)
        found = [DepthProfile(lam, one, None, 0.0)]
        if self.layer.thickness_m is not None:
            once = np.exp(-lam * self.layer.thickness_m)
            for top in ((lam - kappa) / (lam + kappa), one):
                found.append(DepthProfile(lam, top * once, one, self.layer.thickness_m))
        return found

    def weights(self, u: Array, v: Array) -> list[ComplexArray]:
        """Return the weight of each profile at wave numbers u, v (K,) [1/m]."""
        kappa = np.hypot(u, v)
        lam = layer_lambda(self.layer, kappa, self.frequency_hz)
        width = np.sinc(0.5 * v * self.opening_m / np.pi) ** 2
        electric = self.j_omega_mu * width * u**2 / kappa**2
        found: list[ComplexArray] = [electric * kappa / (lam * (lam + kappa))]
        faces = self.lower_face(kappa)
        if faces is None or self.layer.thickness_m is None:
            return found
        twice = np.exp(-2 * lam * self.layer.thickness_m)
        magnetic = width * v**2 * lam**2 / (kappa**2 * self.sigma)
        tops = ((lam - kappa) / (lam + kappa), np.ones_like(lam))
        for weight, top, bottom in zip((electric, magnetic), tops, faces, strict=True):
            found.append(-weight * bottom / ((1 - top * bottom * twice) * 2 * lam))
        return found

    def coil_profile(self, k: Array) -> DepthProfile:
        """Return how the coil's field runs with depth, per unit of its value in air without the metal (K,).

        Half-space: k / (k + lambda) exp(lambda z), doubled field excluded as in the formula
        E_phi = -2 j omega mu0 i I integral of M exp(-k h) profile / 2 J1(k r) dk.
        """
        admittance = surface_admittance((self.layer, *self.below), k, self.frequency_hz)
        lam = layer_lambda(self.layer, k, self.frequency_hz)
        surface = k / (k + admittance)
        faces = self.lower_face(k)
        if faces is None or self.layer.thickness_m is None:
            return DepthProfile(lam, surface, None, 0.0)
        once = np.exp(-lam * self.layer.thickness_m)
        share = surface / (1 + faces[0] * once**2)
        return DepthProfile(lam, share, share * faces[0] * once, self.layer.thickness_m)
