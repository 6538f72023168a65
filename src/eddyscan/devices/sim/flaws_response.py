"""What the slots add to the coil's impedance: tables of the thin-slot model, read at the true place.

The table holds for an upright coil over a flat half-space. On the curved part
the coil's place is unrolled round the slot's centre and the surface's curvature
counts as lift-off; a tilted coil is taken at the upright lift-off that gives
the same change over sound metal. Both are approximations: good below 5 deg and
above ten coil radii of curvature, unverified beyond. Slots do not feel each other.
"""

from __future__ import annotations

import threading

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.devices.sim.flaws import Flaw
from eddyscan.physics import Coil, Conductor, Slot, SlotTable, slot_table


class SlotSignals:
    """Tables of every slot at one frequency, built in the background from the first day on disk."""

    def __init__(self, flaws: tuple[Flaw, ...], coil: Coil, conductor: Conductor, frequency_hz: float) -> None:
        self._flaws = flaws
        self._tables: list[SlotTable | None] = [None] * len(flaws)
        self._faults: list[Exception] = []
        self._arguments = (coil, conductor, frequency_hz)
        self._builder = threading.Thread(target=self._build, name="slot-tables", daemon=True)
        self._builder.start()

    def change_ohm(self, spot_mm: Array, lift_off_mm: float) -> complex:
        """Return what all slots together change [ohm] at a spot (3,) [mm, part]; waits for its table."""
        total = 0j
        for number, flaw in enumerate(self._flaws):
            if float(np.linalg.norm(spot_mm - flaw.centre_mm)) < self._reach_mm(flaw):
                x, y = flaw.local_mm(spot_mm)
                total += complex(self._table(number).change_ohm(x, y, lift_off_mm, beyond_is_zero=True))
        return total

    def _reach_mm(self, flaw: Flaw) -> float:
        return flaw.size.length_mm / 2 + 5 * self._arguments[0].outer_radius_mm

    def _table(self, number: int) -> SlotTable:
        table = self._tables[number]
        if table is None:
            self._builder.join()
            if self._faults:
                raise self._faults[0]
            table = self._tables[number]
        assert table is not None
        return table

    def _build(self) -> None:
        try:
            for number, flaw in enumerate(self._flaws):
                size = flaw.size
                slot = Slot(size.length_mm, size.depth_mm, size.opening_mm, size.profile)
                self._tables[number] = slot_table(slot, *self._arguments)
        except Exception as fault:  # shown to whoever reads next
            self._faults.append(fault)
