"""Going to a pose from anywhere without meeting the part."""

from __future__ import annotations

from typing import TYPE_CHECKING

from eddyscan.core.frames import Array
from eddyscan.scanning.targets import with_z

if TYPE_CHECKING:
    from eddyscan.scanning.running import Scan

SLOW_MM = 2.0  # the last stretch down to the part is driven at approach speed


def hop(scan: Scan, target: Array, *, slowly: bool = True) -> None:
    """Go to a pose from anywhere: up, across, down last; the last stretch slowly where the part is near."""
    here = scan.stage.position()[: len(target)]
    height = max(scan.height_mm, float(target[2]))
    if here[2] < height:
        scan.stage.move(with_z(here, height))
        here = with_z(here, height)
    scan.stage.move(with_z(target, max(height, float(here[2]))))
    near = float(target[2]) + min(scan.technique.scan.clearance_mm, SLOW_MM)
    if slowly and near < height:
        scan.stage.move(with_z(target, near))
    scan.stage.move(target, scan.technique.scan.approach_speed_mm_s if slowly else None)
