"""The study's way: move, settle, read, store - one point after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import IntArray
from eddyscan.core.plan import SCAN
from eddyscan.core.record import POSITION_DOUBTFUL, Reading
from eddyscan.scanning.hops import hop
from eddyscan.scanning.part_watch import PartWatch

if TYPE_CHECKING:
    from eddyscan.scanning.running import Scan


def scan_in_steps(scan: Scan) -> None:
    """Visit the plan's poses in order; a pose whose reading exists is not visited again."""
    done = scan.sink.done()
    plan = scan.plan
    has_reading = [(int(r), int(p)) in done for r, p in zip(plan.row, plan.point, strict=True)]
    for count, leg in enumerate(legs(plan.kind, has_reading), len(done) + 1):
        watch_part(scan, int(plan.row[leg[-1]]))
        approach_leg(scan, leg[:-1], leg[-1])
        read_point(scan, leg[-1])
        scan.progress("scan", count, plan.n_scan)
    watch_part(scan, None)


def watch_part(scan: Scan, row: int | None) -> None:
    """Before a row (None: after the last): read the reference point again when a block of rows is over."""
    every = scan.technique.scan.watch_rows
    if every == 0 or (row is not None and row == scan.row):
        return
    if scan.watch is None:
        if row is None:
            return
        scan.watch = PartWatch(scan)
    elif row is None or scan.rows_since_watch >= every:
        scan.watch.look()
        scan.rows_since_watch = 0
    elif scan.watch.references == 1 and scan.at is not None:
        scan.watch.add(scan.at)
    scan.rows_since_watch += 1
    scan.row = row


def approach_leg(scan: Scan, leading: list[int], index: int) -> None:
    """Go to a pose through the poses that lead to it; from anywhere else up, across and down."""
    for each in (*leading, index):
        if scan.at is None or each != scan.at + 1:
            hop(scan, scan.targets[each], slowly=bool(scan.plan.is_scan[each]))
        else:
            scan.stage.move(scan.targets[each], float(scan.plan.speed_mm_s[each]) or None)
        scan.at = each


def legs(kind: IntArray, has_reading: list[bool]) -> list[list[int]]:
    """Group the pose numbers still to visit: each leg ends at a point that lacks its reading.

    Links and approaches belong to the leg they lead into; those that only lead
    to points already read are left out.
    """
    out: list[list[int]] = []
    leading: list[int] = []
    for index, what in enumerate(kind):
        if what != SCAN:
            leading.append(index)
        elif has_reading[index]:
            leading = []
        else:
            out.append([*leading, index])
            leading = []
    return out


def read_point(scan: Scan, index: int) -> None:
    """Settle, read the impedance and the axes, and make the reading durable."""
    scan.clock.sleep(scan.technique.scan.settle_s)
    heard = scan.instrument.read()
    position, target = scan.face_of(scan.stage.position()), scan.faces[index]
    flag = heard.flag
    if np.abs(position - target).max() > scan.technique.scan.position_tolerance_mm:
        flag |= POSITION_DOUBTFUL
    x, y, z = (float(v) for v in position)
    tx, ty, tz = (float(v) for v in target)
    reading = Reading(
        row=int(scan.plan.row[index]),
        point=int(scan.plan.point[index]),
        time_s=heard.time_s - scan.began_s,
        stage_mm=(x, y, z),
        frequency_hz=scan.technique.drive.frequency_hz,
        impedance_ohm=heard.impedance_ohm,
        flag=flag,
        target_mm=(tx, ty, tz),
    )
    scan.sink.write([reading])
