"""Scanning without stopping: constant speed along a row, readings placed by measured positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, IntArray
from eddyscan.core.record import POSITION_DOUBTFUL, Reading
from eddyscan.devices.protocols import ImpedanceReading, PathSample, PathStage, Stage
from eddyscan.scanning.hops import hop
from eddyscan.scanning.latency import Latency, measure_latency
from eddyscan.scanning.stepping import approach_leg, legs, read_point, watch_part
from eddyscan.scanning.trajectory import RowPath, row_path

if TYPE_CHECKING:
    from eddyscan.scanning.running import Scan

ROUND_S = 0.025  # between two looks at the axes; at 25 mm/s they move 0.6 mm
HELD_UP_S = 0.3
DOUBTFUL_TOLERANCES = 2.0  # a moving probe may be this many position tolerances beside its path
MOST_BEHIND_MM = 0.5  # and this far along it from where the timing has it: its measured place counts


def scan_in_rows(scan: Scan, mode: str) -> None:
    """Drive every row that lacks readings at constant speed, in "row" or "pvt" mode."""
    stage = scan.stage
    if not isinstance(stage, PathStage) or mode not in stage.path_modes():
        offered = ", ".join(("step", *(stage.path_modes() if isinstance(stage, PathStage) else ())))
        raise TechniqueError(
            f"scan.mode is {mode!r}, this stage ({stage.identity().model}) offers {offered}. "
            "Change mode in technique.toml, or use another stage."
        )
    done = scan.sink.done()
    plan, count = scan.plan, len(done)
    has_reading = [(int(r), int(p)) in done for r, p in zip(plan.row, plan.point, strict=True)]
    latency: Latency | None = None
    for leg, run in strokes(legs(plan.kind, has_reading), plan.row):
        watch_part(scan, int(plan.row[run[0]]))
        approach_leg(scan, leg, run[0])
        last, stuck = run[-1], False
        if latency is None:
            latency = measure_latency(scan, mode)
        while run:
            if len(run) == 1 or stuck:
                read_point(scan, run[0])
                count, run, stuck = count + 1, run[1:], False
            else:
                stored = _Stroke(scan, mode, run, latency.seconds).drive()
                count, run, stuck = count + len(stored), [i for i in run if i not in stored], not stored
            scan.progress("scan", count, plan.n_scan)
            if run:
                hop(scan, scan.targets[run[0]])
        scan.at = last
    watch_part(scan, None)


def strokes(legs_to_go: list[list[int]], row: Sequence[int] | IntArray) -> list[tuple[list[int], list[int]]]:
    """Group legs to (poses that lead to a run, the run's poses): a run is driven without stopping.

    A run ends where the row ends or where readings already exist.
    """
    out: list[tuple[list[int], list[int]]] = []
    for leg in legs_to_go:
        index = leg[-1]
        if out and len(leg) == 1 and out[-1][1][-1] == index - 1 and row[index] == row[index - 1]:
            out[-1][1].append(index)
        else:
            out.append((leg[:-1], [index]))
    return out


class _Drivable(PathStage, Stage, Protocol):
    """A stage that moves and follows paths."""


@dataclass
class _Stroke:
    """One run of points driven at constant speed."""

    scan: Scan
    mode: str
    run: list[int]
    latency_s: float
    times: list[Array] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    waiting: list[tuple[int, ImpedanceReading]] = field(default_factory=list)
    stamp_delay_s: float = 0.0
    last_round_s: float = 0.0
    stored: set[int] = field(default_factory=set)

    def drive(self) -> set[int]:
        """Follow the path, read at every point, store what is placed; return the poses stored.

        When something held this program up for longer than the axes were told to
        go on, they have come to rest by themselves: what is not stored then is
        left for another stroke.
        """
        scan, stage = self.scan, cast(_Drivable, self.scan.stage)
        path = self._path()
        axes = len(path.path.position[0])
        self._add(PathSample(np.full(axes, scan.clock.now()), path.path.position[0], True))
        began = stage.start_path(path.path, self.mode)
        self.last_round_s = scan.clock.now()
        next_point, moving = 0, True
        while moving or next_point < len(self.run):
            if scan.clock.now() - self.last_round_s > HELD_UP_S and moving:
                stage.stop()
                scan.sink.note("event", {"event": "held up", "row": int(scan.plan.row[self.run[0]])})
                return self.stored
            due, round_due = self._due(path, began, next_point), self.last_round_s + ROUND_S
            if due <= round_due or not moving:
                scan.clock.sleep(min(due - scan.clock.now(), ROUND_S))
                self._read(self.run[next_point])
                next_point += 1
            else:
                scan.clock.sleep(round_due - scan.clock.now())
            if moving:
                self.last_round_s = scan.clock.now()
                sample = stage.follow_path()
                self._add(sample)
                moving = sample.moving
            self._store(path, began)
        self._add(PathSample(np.full(axes, scan.clock.now()), scan.stage.position(), False))
        self._store(path, began)
        return self.stored

    def _path(self) -> RowPath:
        scan, points = self.scan, self.scan.targets[self.run]
        speed = float(np.median(scan.plan.speed_mm_s[self.run[1:]]))
        return row_path(points, speed, scan.stage.axes())

    def _due(self, path: RowPath, began: float, k: int) -> float:
        """Return when to ask the instrument so that what it measures is the coil at point `k`."""
        if k >= len(self.run):
            return float("inf")
        return began + float(path.passes_s[k]) - self.stamp_delay_s + self.latency_s

    def _read(self, index: int) -> None:
        asked = self.scan.clock.now()
        heard = self.scan.instrument.read()
        self.stamp_delay_s = 0.7 * self.stamp_delay_s + 0.3 * (heard.time_s - asked)
        self.waiting.append((index, heard))

    def _add(self, sample: PathSample) -> None:
        self.times.append(sample.time_s)
        self.positions.append(sample.position)
        del self.times[:-200], self.positions[:-200]

    def _store(self, path: RowPath, began: float) -> None:
        """Make every reading durable whose place is bracketed by measured positions."""
        times, positions = np.array(self.times), np.array(self.positions)
        known = float(times[-1].min())
        placed = [entry for entry in self.waiting if entry[1].time_s - self.latency_s <= known]
        if not placed:
            return
        self.waiting = [entry for entry in self.waiting if entry not in placed]
        readings = []
        for index, heard in placed:
            when = heard.time_s - self.latency_s
            where = np.array([np.interp(when, times[:, k], positions[:, k]) for k in range(positions.shape[1])])
            readings.append(self._reading(index, heard, where, self._beside(path, when - began, where)))
        self.scan.sink.write(readings)
        self.stored.update(index for index, _ in placed)

    def _beside(self, path: RowPath, since_s: float, where: Array) -> float:
        """Return how far [mm] a place is from the path: across it; along it only what is no mere delay."""
        planned, velocity = path.path.at(since_s)
        off, speed = where - planned, float(np.linalg.norm(velocity))
        along = float(off @ velocity) / speed if speed > 0 else 0.0
        across = float(np.linalg.norm(off - along * velocity / speed if speed > 0 else off))
        return max(across, abs(along) - MOST_BEHIND_MM)

    def _reading(self, index: int, heard: ImpedanceReading, where: Array, off_mm: float) -> Reading:
        scan = self.scan
        doubtful = off_mm > DOUBTFUL_TOLERANCES * scan.technique.scan.position_tolerance_mm
        x, y, z = (float(v) for v in scan.face_of(where))
        tx, ty, tz = (float(v) for v in scan.faces[index])
        return Reading(
            row=int(scan.plan.row[index]),
            point=int(scan.plan.point[index]),
            time_s=heard.time_s - self.latency_s - scan.began_s,
            stage_mm=(x, y, z),
            frequency_hz=scan.technique.drive.frequency_hz,
            impedance_ohm=heard.impedance_ohm,
            flag=heard.flag | (POSITION_DOUBTFUL if doubtful else 0),
            target_mm=(tx, ty, tz),
        )
