"""A stack of flat layers, top to bottom, and how it reflects a coil's field."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, MU0


@dataclass(frozen=True)
class Layer:
    """One layer.

    Attributes
    ----------
    conductivity_ms_m : 0 (air, paint) to 65 MS/m
    thickness_mm : None for a half-space (the last layer only)
    relative_permeability : at least 1 for metals in use; anything positive

    Raises
    ------
    TechniqueError
        A value out of range; a conductivity that looks like S/m is named as such.
    """

    conductivity_ms_m: float
    thickness_mm: float | None = None
    relative_permeability: float = 1.0

    def __post_init__(self) -> None:
        checks.conductivity("conductivity_ms_m", self.conductivity_ms_m)
        checks.positive("relative_permeability", self.relative_permeability, unit="")
        if self.thickness_mm is not None:
            checks.positive("thickness_mm", self.thickness_mm, unit="mm")

    @property
    def conductivity_s_m(self) -> float:
        """Conductivity [S/m]."""
        return self.conductivity_ms_m * 1e6

    @property
    def thickness_m(self) -> float | None:
        """Thickness [m], None for a half-space."""
        return None if self.thickness_mm is None else self.thickness_mm * MM


@dataclass(frozen=True)
class Conductor:
    """Layers from the coil's side downwards; air below a last layer of finite thickness.

    Raises
    ------
    TechniqueError
        No layer, or a half-space that is not the last layer.
    """

    layers: tuple[Layer, ...]

    def __post_init__(self) -> None:
        if not self.layers:
            raise TechniqueError("a conductor needs at least one layer, 0 were given.")
        for number, layer in enumerate(self.layers[:-1]):
            if layer.thickness_mm is None:
                raise TechniqueError(
                    f"layer {number} of {len(self.layers)} has no thickness_mm: only the last may be a half-space."
                )

    @classmethod
    def half_space(cls, conductivity_ms_m: float, relative_permeability: float = 1.0) -> Conductor:
        """Return a metal without a back wall."""
        return cls((Layer(conductivity_ms_m, None, relative_permeability),))

    @classmethod
    def plate(cls, conductivity_ms_m: float, thickness_mm: float, relative_permeability: float = 1.0) -> Conductor:
        """Return one plate in air."""
        return cls((Layer(conductivity_ms_m, thickness_mm, relative_permeability),))


def skin_depth_mm(conductivity_ms_m: float, frequency_hz: float, relative_permeability: float = 1.0) -> float:
    """Return the standard depth of penetration [mm]: sqrt(2 / (omega mu sigma)) (ISO 12718)."""
    checks.positive("conductivity_ms_m", conductivity_ms_m, unit="MS/m")
    checks.conductivity("conductivity_ms_m", conductivity_ms_m)
    checks.positive("frequency_hz", frequency_hz, unit="Hz")
    checks.positive("relative_permeability", relative_permeability, unit="")
    return float(1.0 / (np.sqrt(np.pi * frequency_hz * MU0 * relative_permeability * conductivity_ms_m * 1e6) * MM))


def layer_lambda(layer: Layer, k: Array, frequency_hz: float) -> ComplexArray:
    """Return lambda(k) = sqrt(k^2 + j omega mu sigma) [1/m] of a layer."""
    g = 2j * np.pi * frequency_hz * MU0 * layer.relative_permeability * layer.conductivity_s_m
    return np.asarray(np.sqrt(np.asarray(k, dtype=np.complex128) ** 2 + g))


def surface_admittance(layers: tuple[Layer, ...], k: Array, frequency_hz: float) -> ComplexArray:
    """Return the transverse-electric admittance Y(k) [1/m] seen from above a stack; air above gives Y = k.

    The recursion is that of a transmission line: Y <- y (Y + y th) / (y + Y th)
    with y = lambda / mu_r and th = tanh(lambda t), from the bottom upwards
    (Cheng, Dodd and Deeds, Int. J. NDT 3 (1971) 109, in admittance form).
    """
    below: ComplexArray = np.asarray(k, dtype=np.complex128)
    for layer in reversed(layers):
        lam = layer_lambda(layer, k, frequency_hz)
        own = lam / layer.relative_permeability
        if layer.thickness_m is None:
            below = own
            continue
        tanh = np.tanh(lam * layer.thickness_m)
        below = own * (below + own * tanh) / (own + below * tanh)
    return below


def reflection(conductor: Conductor, k: Array, frequency_hz: float) -> ComplexArray:
    """Return Gamma(k) = (k - Y) / (k + Y) of the whole stack (K,)."""
    admittance = surface_admittance(conductor.layers, k, frequency_hz)
    return np.asarray((k - admittance) / (k + admittance))


def normal_admittance(layers: tuple[Layer, ...], k: Array, frequency_hz: float) -> ComplexArray:
    """Return the transverse-magnetic admittance sigma / lambda [S] seen from above a stack; 0 above air.

    The same transmission-line recursion with y = sigma / lambda: no current leaves a metal into air.
    """
    below: ComplexArray = np.zeros(np.shape(k), dtype=np.complex128)
    for layer in reversed(layers):
        if layer.conductivity_ms_m == 0:
            below = np.zeros(np.shape(k), dtype=np.complex128)
            continue
        lam = layer_lambda(layer, k, frequency_hz)
        own = layer.conductivity_s_m / lam
        if layer.thickness_m is None:
            below = own
            continue
        tanh = np.tanh(lam * layer.thickness_m)
        below = own * (below + own * tanh) / (own + below * tanh)
    return below
