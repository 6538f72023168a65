"""Noticing a part that moved: a reference point is read again after every block of rows.

What it sees is lift-off. A part that slid along a direction in which its surface
does not rise at the reference point stays unnoticed; a reference point on a
slope sees more.
"""

from __future__ import annotations

from dataclasses import dataclass
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


@dataclass(frozen=True)
class _Reference:
    """A pose, its reading at the start, and how that changes with lift-off."""

    index: int
    at_start: complex
    ohm_per_mm: float


class PartWatch:
    """Reference points of one run: both ends of its first row, so that one is never far."""

    def __init__(self, scan: Scan) -> None:
        self._scan = scan
        self._references: list[_Reference] = []
        first = int(np.flatnonzero(scan.plan.kind == SCAN)[0])
        hop(scan, scan.targets[first])
        self.add(first)

    @property
    def references(self) -> int:
        """Return how many points can be looked at."""
        return len(self._references)

    def add(self, index: int) -> None:
        """Take the pose where the probe stands as a reference point, when lift-off shows there."""
        scan, target = self._scan, self._scan.targets[index]
        at_start, noise = self._read()
        lifted_target = with_z(target, float(target[2]) + LIFT_MM)
        scan.stage.move(lifted_target, scan.technique.scan.approach_speed_mm_s)
        lifted, _ = self._read()
        scan.at = None
        change = abs(lifted - at_start)
        works = change > LEAST_CONTRAST * noise and change > 0
        if works:
            self._references.append(_Reference(index, at_start, change / LIFT_MM))
        scan.sink.note(
            "event",
            {
                "event": "reference point" if works else "reference point tells nothing: no contrast with lift-off",
                "pose": index,
                "impedance_ohm": [at_start.real, at_start.imag],
                "ohm_per_mm": change / LIFT_MM,
            },
        )

    def look(self) -> None:
        """Read the nearest reference point again.

        Raises
        ------
        ScanAborted
            When the reading changed by more than the technique's `watch_limit_mm` of lift-off.
        """
        if not self._references:
            return
        scan, limit = self._scan, self._scan.technique.scan.watch_limit_mm
        here = scan.stage.position()[:2]
        chosen = min(self._references, key=lambda r: float(np.linalg.norm(scan.targets[r.index][:2] - here)))
        hop(scan, scan.targets[chosen.index])
        now, _ = self._read()
        scan.at = None
        shift = abs(now - chosen.at_start) / chosen.ohm_per_mm
        scan.sink.note("event", {"event": "reference point again", "pose": chosen.index, "change_mm": shift})
        if shift > limit:
            raise ScanAborted(
                f"the part moved: at the reference point (row {scan.plan.row[chosen.index]}, point "
                f"{scan.plan.point[chosen.index]}) the reading changed as by {shift:.2f} mm of lift-off (limit "
                f"{limit:g}). Readings since the last good look are doubtful. Clamp the part, align it again, "
                "scan into a new record."
            )

    def _read(self) -> tuple[complex, float]:
        self._scan.clock.sleep(self._scan.technique.scan.settle_s)
        values = np.array([self._scan.instrument.read().impedance_ohm for _ in range(READS)])
        return complex(values.mean()), float(np.abs(values - values.mean()).max())
