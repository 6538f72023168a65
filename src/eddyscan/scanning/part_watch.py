"""Noticing a part that moved: a reference point is read again after every block of rows.

What it sees is lift-off. A part that slid along a direction in which its surface
does not rise at the reference point stays unnoticed; a reference point on a
slope sees more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.errors import ScanAborted
from eddyscan.core.plan import SCAN
from eddyscan.scanning.hops import hop
from eddyscan.scanning.targets import with_z

if TYPE_CHECKING:
    from eddyscan.scanning.running import Scan

READS = 3
LIFT_MM = 0.2
LEAST_CONTRAST = 5.0  # change over a lift in standard deviations of a reading


class PartWatch:
    """The reference point of one run: its reading at the start and how it changes with lift-off."""

    def __init__(self, scan: Scan) -> None:
        self._scan = scan
        self._index = int(np.flatnonzero(scan.plan.kind == SCAN)[0])
        target = scan.targets[self._index]
        hop(scan, target)
        self.at_start, noise = self._read()
        scan.stage.move(with_z(target, float(target[2]) + LIFT_MM), scan.technique.scan.approach_speed_mm_s)
        lifted, _ = self._read()
        change = abs(lifted - self.at_start)
        self.ohm_per_mm = change / LIFT_MM
        self.works = change > LEAST_CONTRAST * noise and change > 0
        scan.at = None
        scan.sink.note(
            "event",
            {
                "event": "reference point"
                if self.works
                else "reference point tells nothing: no contrast with lift-off",
                "pose": self._index,
                "impedance_ohm": [self.at_start.real, self.at_start.imag],
                "ohm_per_mm": self.ohm_per_mm,
            },
        )

    def look(self) -> None:
        """Read the reference point again.

        Raises
        ------
        ScanAborted
            When the reading changed by more than the technique's `watch_limit_mm` of lift-off.
        """
        if not self.works:
            return
        scan, limit = self._scan, self._scan.technique.scan.watch_limit_mm
        hop(scan, scan.targets[self._index])
        now, _ = self._read()
        scan.at = None
        shift = abs(now - self.at_start) / self.ohm_per_mm
        scan.sink.note("event", {"event": "reference point again", "change_mm": shift})
        if shift > limit:
            raise ScanAborted(
                f"the part moved: at the reference point (row {scan.plan.row[self._index]}, point "
                f"{scan.plan.point[self._index]}) the reading changed as by {shift:.2f} mm of lift-off (limit "
                f"{limit:g}). Readings since the last good look are doubtful. Clamp the part, align it again, "
                "scan into a new record."
            )

    def _read(self) -> tuple[complex, float]:
        self._scan.clock.sleep(self._scan.technique.scan.settle_s)
        values = np.array([self._scan.instrument.read().impedance_ohm for _ in range(READS)])
        return complex(values.mean()), float(np.abs(values - values.mean()).max())
