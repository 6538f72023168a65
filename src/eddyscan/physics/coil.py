"""An air-cored coil of rectangular cross-section, and what it is in air.

The field of such a coil is a sum over the radial wave number k [1/m]
(Dodd and Deeds, J. Appl. Phys. 39 (1968) 2829). The winding enters through

    R(q) = integral from r1 to r2 of r J1(q r) dr            (any complex q)

which is chi(q r1, q r2) / q^2 in the notation of Dodd and Deeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1, jv

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array
from eddyscan.physics import checks
from eddyscan.physics.quadrature import gauss_panels

MU0 = 4e-7 * np.pi
MM = 1e-3


@dataclass(frozen=True)
class Coil:
    """A coil [mm] whose face looks at the part.

    Attributes
    ----------
    inner_radius_mm, outer_radius_mm : winding radii, 0 < inner < outer
    length_mm : axial length of the winding
    turns : number of turns, uniformly spread over the cross-section

    Raises
    ------
    TechniqueError
        A dimension is not positive, or the inner radius is not below the outer.
    """

    inner_radius_mm: float
    outer_radius_mm: float
    length_mm: float
    turns: float

    def __post_init__(self) -> None:
        for name in ("inner_radius_mm", "outer_radius_mm", "length_mm"):
            checks.positive(name, getattr(self, name), unit="mm")
        checks.positive("turns", self.turns, unit="turns")
        if self.inner_radius_mm >= self.outer_radius_mm:
            raise TechniqueError(
                f"inner_radius_mm = {self.inner_radius_mm:g}: must be below outer_radius_mm = {self.outer_radius_mm:g}."
            )

    @property
    def inner_m(self) -> float:
        """Inner radius [m]."""
        return self.inner_radius_mm * MM

    @property
    def outer_m(self) -> float:
        """Outer radius [m]."""
        return self.outer_radius_mm * MM

    @property
    def length_m(self) -> float:
        """Axial length [m]."""
        return self.length_mm * MM

    @property
    def turn_density(self) -> float:
        """Turns per cross-section [1/m^2]."""
        return self.turns / ((self.outer_m - self.inner_m) * self.length_m)

    @property
    def mean_radius_m(self) -> float:
        """Mean winding radius [m]."""
        return 0.5 * (self.inner_m + self.outer_m)


def winding_integral(coil: Coil, q: NDArray[Any]) -> NDArray[Any]:
    """Return R(q) = integral of r J1(q r) over the winding radii, for real or complex q [1/m].

    Parameters
    ----------
    coil : Coil
    q : (...) float64 or complex128 [1/m]

    Returns
    -------
    integral : (...) same kind as q [m^2]
    """
    span = float(np.abs(q).max(initial=0.0)) * (coil.outer_m - coil.inner_m)
    r, w = gauss_panels(np.linspace(coil.inner_m, coil.outer_m, 2 + int(span / 36)), 24)
    flat = q.ravel()
    bessel = jv(1, flat[:, None] * r) if np.iscomplexobj(flat) else j1(flat[:, None] * r)
    return np.asarray(bessel @ (w * r)).reshape(q.shape)


def source(coil: Coil, k: Array) -> Array:
    """Return M(k) = R(k) (1 - exp(-k l)) / k [m^3], the coil's spectrum seen from below its face (k > 0)."""
    return np.asarray(winding_integral(coil, k) * -np.expm1(-k * coil.length_m) / k)


def wave_numbers(coil: Coil, *, reach_m: float = 0.0, finest_m: float | None = None) -> tuple[Array, Array]:
    """Return quadrature nodes and weights (K,), (K,) [1/m] for integrals over k of this coil's field.

    Panels grow geometrically from zero, so slow features (thick plates, large
    skin depths) are resolved, then follow the oscillation of the Bessel
    functions at `outer radius + reach_m`, up to a cut-off where the
    impedance is converged to 1e-9 (or exp(-k finest_m) has fallen as far).
    """
    largest = coil.outer_m + 0.4 * reach_m
    top = 60.0 / coil.mean_radius_m
    if finest_m is not None and finest_m > 0:
        top = min(top, max(40.0 / finest_m, 20.0 / coil.outer_m))
    step = 4.0 / largest
    edges = np.concatenate([[0.0], step * 2.0 ** np.arange(-16, 1), np.arange(2.0 * step, top + step, step)])
    return gauss_panels(edges, 10)


@lru_cache(maxsize=64)
def air_inductance_h(coil: Coil) -> float:
    """Return the inductance [H] of the coil alone in air.

    Dodd and Deeds (1968), their eq. for the coil in air:
    L0 = 2 pi mu0 i^2 integral of R(k)^2 / k^2 (k l + exp(-k l) - 1) dk. Beyond the last
    node R^2 is replaced by its mean, which leaves 1e-8.
    """
    r1, r2, length = coil.inner_m, coil.outer_m, coil.length_m
    step = 5.0 / r2
    top = max(150.0 / coil.mean_radius_m, min(max(20.0 / length, 20.0 / (r2 - r1)), 4000.0 / coil.mean_radius_m))
    linear = np.arange(2.0 * step, top + step, step)
    k, w = gauss_panels(np.concatenate([[0.0], step * 2.0 ** np.arange(-16, 1), linear]), 12)
    kl = k * length
    axial = np.where(kl < 1e-3, 0.5 * kl**2 - kl**3 / 6 + kl**4 / 24, kl + np.expm1(-kl))
    spectrum = winding_integral(coil, k) ** 2 / k**2 * axial
    last = float(linear[-1])
    tail = (r1 + r2) / np.pi * (length / (3 * last**3) - 1 / (4 * last**4))  # R^2 -> (r1 + r2) / (pi k^3) on average
    return float(2 * np.pi * MU0 * coil.turn_density**2 * (w @ spectrum + tail))
