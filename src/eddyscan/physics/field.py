"""The coil's electric field in the metal: where the current flows and how deep it reaches."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j1

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, MU0, Coil, source, wave_numbers
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.metal import SlottedMetal


def field_v_m(
    coil: Coil, conductor: Conductor, frequency_hz: float, *, r_mm: ArrayLike, z_mm: ArrayLike, lift_off_mm: float
) -> ComplexArray:
    """Return the azimuthal electric field per ampere in the top layer of a conductor.

    E_phi(r, z) = -j omega mu0 i integral of M(k) exp(-k h) (1 + Gamma)/2 f(z) J1(k r) dk
    (Dodd and Deeds 1968); f runs from the surface to the layer's lower face. The
    current density is the layer's conductivity times this field.

    Parameters
    ----------
    r_mm : (...) float64 [mm], distance from the coil's axis
    z_mm : (...) float64 [mm], 0 at the surface, negative in the metal; broadcast with `r_mm`
    lift_off_mm : float [mm]

    Returns
    -------
    field : (...) complex128 [V/m per A]

    Raises
    ------
    TechniqueError
        A depth above the surface or below the top layer; a magnetic top layer.
    """
    checks.positive("frequency_hz", frequency_hz, unit="Hz")
    checks.lift_offs(np.asarray(lift_off_mm, dtype=np.float64))
    layer = conductor.layers[0]
    r, z = np.broadcast_arrays(np.asarray(r_mm, dtype=np.float64), np.asarray(z_mm, dtype=np.float64))
    floor = -np.inf if layer.thickness_mm is None else -layer.thickness_mm
    if z.size and not (z.max() <= 0 and z.min() >= floor):
        worst = z.max() if z.max() > 0 else z.min()
        raise TechniqueError(f"z_mm = {worst:g}: must lie from {floor:g} to 0 mm, inside the top layer.")
    if layer.relative_permeability != 1.0:
        raise TechniqueError(
            f"relative_permeability = {layer.relative_permeability:g}: "
            "the field is given for non-magnetic metal (1) only."
        )
    metal = SlottedMetal(layer, conductor.layers[1:], frequency_hz, 0.0)
    k, w = wave_numbers(coil, reach_m=float(np.abs(r).max(initial=0.0)) * MM, finest_m=lift_off_mm * MM)
    spectrum = w * source(coil, k) * np.exp(-k * lift_off_mm * MM)
    profile = metal.coil_profile(k)
    depths, which = np.unique(z.ravel() * MM, return_inverse=True)
    along = profile.values(depths) * spectrum[:, None]
    result = np.empty(r.size, dtype=np.complex128)
    for number in range(len(depths)):
        mine = which == number
        result[mine] = j1(np.outer(r.ravel()[mine] * MM, k)) @ along[:, number]
    scale = -2j * np.pi * frequency_hz * MU0 * coil.turn_density
    return np.asarray(scale * result).reshape(r.shape)
