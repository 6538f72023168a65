"""Several slots on one flat stretch of surface: their signals add; they do not disturb each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eddyscan.core.frames import ComplexArray
from eddyscan.physics.slot import to_slot_frame
from eddyscan.physics.tables import SlotTable


@dataclass(frozen=True)
class PlacedSlot:
    """A slot's table at a place.

    Attributes
    ----------
    table : SlotTable
    centre_mm : (x, y) of the slot's middle [mm, surface plane]
    angle_deg : direction of its length, from x towards y
    """

    table: SlotTable
    centre_mm: tuple[float, float]
    angle_deg: float = 0.0

    def change_ohm(self, x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike) -> ComplexArray:
        """Return dZ (...) [ohm] at coil positions in the surface plane; 0 where the coil no longer sees the slot."""
        x, y = np.asarray(x_mm, dtype=np.float64), np.asarray(y_mm, dtype=np.float64)
        along, beside = to_slot_frame(x, y, centre_mm=self.centre_mm, angle_deg=self.angle_deg)
        return self.table.change_ohm(along, beside, lift_off_mm, beyond_is_zero=True)


def slots_change_ohm(
    slots: Sequence[PlacedSlot], x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike
) -> ComplexArray:
    """Return the sum of dZ (...) [ohm] of several slots, without their interaction.

    Two slots nearer than about a coil radius or a skin depth do disturb each
    other's current; that is not modelled.
    """
    x, y, h = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x_mm, y_mm, lift_off_mm)))
    total = np.zeros(x.shape, dtype=np.complex128)
    for slot in slots:
        total += slot.change_ohm(x, y, h)
    return total
