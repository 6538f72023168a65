"""Eddy currents: coil, layered conductor, slot, lift-off and tilt.

Time convention exp(+j omega t); impedances in raw ohms, unrotated, without the
wire's dc resistance. Lengths in mm and conductivities in MS/m at the boundary.
"""

from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor, Layer, skin_depth_mm
from eddyscan.physics.impedance import impedance_change_ohm, impedance_ohm, least_lift_off_mm
from eddyscan.physics.lift_off import LiftOffCurve

__all__ = [
    "Coil",
    "Conductor",
    "Layer",
    "LiftOffCurve",
    "air_inductance_h",
    "impedance_change_ohm",
    "impedance_ohm",
    "least_lift_off_mm",
    "skin_depth_mm",
]
