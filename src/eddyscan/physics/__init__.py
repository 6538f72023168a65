"""Eddy currents: coil, layered conductor, slot, lift-off and tilt.

Time convention exp(+j omega t); impedances in raw ohms, unrotated, without the
wire's dc resistance. Lengths in mm and conductivities in MS/m at the boundary.

Not modelled: edges of the part (keep 1.7 outer coil radii away), surfaces bent
tighter than ten coil radii (`too_curved`), openings over a quarter of the skin
depth (`slot_warnings`), ferrite cores, pits, slots that interact, slots in magnetic
metal. `docs/decisions/physics-limits.md` lists what happens at each limit.
"""

from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor, Layer, skin_depth_mm
from eddyscan.physics.curvature import curved_lift_off_mm, effective_radius_mm, too_curved
from eddyscan.physics.impedance import impedance_change_ohm, impedance_ohm, least_lift_off_mm
from eddyscan.physics.lift_off import LiftOffCurve
from eddyscan.physics.placed import PlacedSlot, slots_change_ohm
from eddyscan.physics.slot import Slot, slot_warnings, to_slot_frame
from eddyscan.physics.slot_solver import SlotSolver, slot_change_ohm
from eddyscan.physics.tables import SlotTable, build_table, slot_table, table_grid

__all__ = [
    "Coil",
    "Conductor",
    "Layer",
    "LiftOffCurve",
    "PlacedSlot",
    "Slot",
    "SlotSolver",
    "SlotTable",
    "air_inductance_h",
    "build_table",
    "curved_lift_off_mm",
    "effective_radius_mm",
    "impedance_change_ohm",
    "impedance_ohm",
    "least_lift_off_mm",
    "skin_depth_mm",
    "slot_change_ohm",
    "slot_table",
    "slot_warnings",
    "slots_change_ohm",
    "table_grid",
    "to_slot_frame",
    "too_curved",
]
