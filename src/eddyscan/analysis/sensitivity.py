"""How much of a small crack's signal is left at the lift-off the coil really had."""

from __future__ import annotations

import numpy as np

from eddyscan.analysis.detection import field_power
from eddyscan.core.frames import Array
from eddyscan.physics.sound_response import SoundResponse

KNOTS = 25
RADII = 40
SENSITIVE = 0.5


def relative_sensitivity(response: SoundResponse, lift_off_mm: Array, *, nominal_mm: float) -> Array:
    """Return the strongest response to a small crack at each lift-off over that at the nominal one (M,).

    The response is the square of the field at the surface (see `detection`), so no
    compensation in the data can restore what is lost here: it is a coverage layer.

    Parameters
    ----------
    response : SoundResponse
    lift_off_mm : (M,) [mm]; NaN gives 0
    nominal_mm : float [mm] the technique's lift-off
    """
    knots = np.linspace(0.0, response.largest_clearance_mm, KNOTS)
    radii = np.linspace(0.0, 1.5 * response.coil.outer_radius_mm, RADII)
    power = np.log([field_power(response, float(h), radii).max() for h in knots])
    at_nominal = np.interp(nominal_mm, knots, power)
    relative = np.exp(np.interp(np.clip(lift_off_mm, 0.0, knots[-1]), knots, power) - at_nominal)
    return np.asarray(np.where(np.isfinite(lift_off_mm), relative, 0.0))
