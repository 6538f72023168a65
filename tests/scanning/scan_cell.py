"""What scanning tests share: a small wavy part, its plan, an instrument that sees the true lift-off, a sink."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field

import numpy as np

from eddyscan.core.plan import APPROACH, LINK, SCAN, Coverage, ScanPlan
from eddyscan.core.technique import Drive, Technique
from eddyscan.devices.protocols import Identity, ImpedanceReading
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from tests.devices.zaber_cell import zaber_cell

T_STAGE_PART = np.array([[1.0, 0, 0, 5.0], [0, 1, 0, 40.0], [0, 0, 1, 5.0], [0, 0, 0, 1]])
LIFT_OFF_MM = 0.5
APERTURE_S = 0.006


def surface_z(x):
    return 10.0 + 3.0 * np.sin(2 * np.pi * np.asarray(x) / 60.0)


def wavy_plan(*, rows=3, points=9, length_mm=40.0, pitch_mm=5.0, speed_mm_s=25.0) -> ScanPlan:
    """Rows along x, there and back, with a link of three poses between them and an approach before the first."""
    poses: list[tuple[int, int, int, float, float, float, float]] = []
    for row in range(rows):
        xs = np.linspace(0, length_mm, points)[:: 1 if row % 2 == 0 else -1]
        y, high = pitch_mm * row, float(surface_z(15)) + 5.0
        kind = APPROACH if row == 0 else LINK
        if row:
            poses.append((LINK, row, -1, float(xs[0]), y - pitch_mm, high, 25.0))
        poses.append((kind, row, -1, float(xs[0]), y, high, 25.0))
        for point, x in enumerate(xs):
            z = float(surface_z(x)) + LIFT_OFF_MM
            poses.append((SCAN, row, point, float(x), y, z, speed_mm_s if point else 5.0))
    table = np.array(poses)
    n, xyz = len(table), table[:, 3:6]
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = np.diag([1.0, -1.0, -1.0]), xyz
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    zero = np.zeros(n)
    kind, row, point = (table[:, k].astype(np.int64) for k in range(3))
    below = xyz - LIFT_OFF_MM * up
    coverage = Coverage(1.0, 1.0, (5.0, 5.0, 5.0), (5.0, 5.0, 5.0), 3.0)
    return ScanPlan(kind, row, point, zero, below, up, T, zero, zero + LIFT_OFF_MM, table[:, 6], zero, coverage)


@dataclass
class LiftOffInstrument:
    """Reads 100 ohm + 50j exp(-true lift-off / mm), averaged at the middle of its aperture, stamped at its end."""

    clock: object
    simulator: object
    fail_after: int | None = None
    failure: BaseException | None = None
    shift_mm: np.ndarray = field(default_factory=lambda: np.zeros(3))
    configured: list[Drive] = field(default_factory=list)
    true_mm: list[np.ndarray] = field(default_factory=list)

    def identity(self) -> Identity:
        return Identity("lift-off", "test", "1")

    def configure(self, drive: Drive) -> None:
        self.configured.append(drive)

    def read(self) -> ImpedanceReading:
        if self.fail_after is not None and len(self.true_mm) >= self.fail_after:
            assert self.failure is not None
            raise self.failure
        self.clock.sleep(APERTURE_S / 2)
        true = self.simulator.true_position()[:3]
        self.true_mm.append(true)
        self.clock.sleep(APERTURE_S / 2)
        part = true - T_STAGE_PART[:3, 3] - self.shift_mm
        lift_off = part[2] - float(surface_z(part[0]))
        return ImpedanceReading(100 + 50j * np.exp(-lift_off), self.clock.now())

    def close(self) -> None: ...


@dataclass
class MemorySink:
    """Keeps readings in order; may fail like a full disk."""

    readings: list = field(default_factory=list)
    notes: list = field(default_factory=list)
    fail_after: int | None = None
    on_write: object = None

    def write(self, readings) -> None:
        if self.fail_after is not None and len(self.readings) >= self.fail_after:
            raise OSError(28, "No space left on device")
        self.readings.extend(readings)
        if self.on_write is not None:
            self.on_write(readings)

    def done(self) -> set[tuple[int, int]]:
        return {(r.row, r.point) for r in self.readings}

    def note(self, key, value) -> None:
        self.notes.append((key, value))

    def noted(self, key):
        return [value for k, value in self.notes if k == key]

    def close(self) -> None: ...


def technique(**scan) -> Technique:
    """Return a technique with these [scan] values; without a watch on the part unless asked for."""
    base = Technique()
    return base.model_copy(update={"scan": base.scan.model_copy(update={"watch_rows": 0, **scan})})


@dataclass
class ScanCell:
    simulator: object
    stage: object
    clock: object
    instrument: LiftOffInstrument
    sink: MemorySink

    def devices(self) -> dict:
        return {"stage": self.stage, "instrument": self.instrument, "clock": self.clock, "sink": self.sink}


@contextlib.contextmanager
def scan_cell(clock, settings: ZaberSettings | None = None, **driver):
    with zaber_cell(clock, settings, **driver) as cell:
        instrument = LiftOffInstrument(clock, cell.simulator)
        yield ScanCell(cell.simulator, cell.stage, clock, instrument, MemorySink())
