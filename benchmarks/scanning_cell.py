"""A block on the simulated stage, scanned in any mode: what the scanning benchmark measures on."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, fields, replace

import numpy as np
from scipy.interpolate import CubicSpline

from eddyscan.core.frames import Array
from eddyscan.core.parts import named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.record import Reading
from eddyscan.core.technique import Technique
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.zaber_settings import STUDY_CHAIN, ZaberStageSettings
from eddyscan.devices.protocols import Clock, Identity, ImpedanceReading
from eddyscan.devices.sim.zaber import STUDY_AXES, ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.devices.trapezoid import rest_to_rest_s
from eddyscan.planning import plan as make_plan
from eddyscan.scanning import run

T_STAGE_PART = np.array([[1.0, 0, 0, 1.0], [0, 1, 0, 50.0], [0, 0, 1, -10.0], [0, 0, 0, 1.0]])
WAVES = {"block-a": (7.5, 150.0), "block-b": (7.5, 150.0), "block-c": (15.0, 140.0)}
APERTURE_S = 0.006
NOISE_OHM = 0.01


class LiftOffInstrument:
    """100 ohm + 50j exp(-true lift-off / mm) with noise, at the middle of its aperture, stamped at the end."""

    def __init__(self, clock: Clock, simulator: ZaberSimulator, part: str, seed: int) -> None:
        self._clock, self._simulator, self._wave = clock, simulator, WAVES[part]
        self._rng = np.random.default_rng(seed)
        self.true_mm: list[Array] = []

    def identity(self) -> Identity:
        return Identity("lift-off", "benchmark", "1")

    def configure(self, drive: object) -> None: ...

    def read(self) -> ImpedanceReading:
        self._clock.sleep(APERTURE_S / 2)
        true = self._simulator.true_position()[:3]
        self.true_mm.append(true)
        self._clock.sleep(APERTURE_S / 2)
        x, _, z = true - T_STAGE_PART[:3, 3]
        amplitude, length = self._wave
        lift_off = z - (30.0 + amplitude * np.sin(2 * np.pi * x / length))
        noise = complex(*self._rng.normal(0.0, NOISE_OHM, 2))
        return ImpedanceReading(complex(100 + 50j * np.exp(-lift_off)) + noise, self._clock.now())

    def close(self) -> None: ...


@dataclass
class MemorySink:
    readings: list[Reading] = field(default_factory=list)
    notes: dict[str, object] = field(default_factory=dict)

    def write(self, readings: list[Reading]) -> None:
        self.readings.extend(readings)

    def done(self) -> set[tuple[int, int]]:
        return {(r.row, r.point) for r in self.readings}

    def note(self, key: str, value: object) -> None:
        self.notes[key] = value

    def close(self) -> None: ...


@dataclass(frozen=True)
class Outcome:
    """One scan: plan, readings, true positions at the readings, times."""

    plan: ScanPlan
    readings: list[Reading]
    true_mm: Array
    duration_s: float
    bound_s: float
    wall_s: float
    latency: dict[str, float] | None

    @property
    def ratio(self) -> float:
        return self.duration_s / self.bound_s

    def lost_doubled(self) -> tuple[int, int]:
        keys = [(r.row, r.point) for r in self.readings]
        return self.plan.n_scan - len(set(keys)), len(keys) - len(set(keys))

    def smear_mm(self) -> float:
        """Return the distance between what rows there and rows back place at the same spot: recorded minus true."""
        off = np.array([r.stage_mm[0] for r in self.readings]) - self.true_mm[:, 0]
        target = np.array([r.target_mm[0] for r in self.readings])
        row = np.array([r.row for r in self.readings])
        ahead = np.array([target[row == k][-1] > target[row == k][0] for k in row])
        return float(abs(off[ahead].mean() - off[~ahead].mean()))

    def z_following_um(self, share: float = 95.0) -> float:
        """Return the recorded height off the row's curve at the recorded x, percentile of its amount."""
        errors = []
        for number in {r.row for r in self.readings}:
            row = [r for r in self.readings if r.row == number]
            target, at = np.array([r.target_mm for r in row]), np.array([r.stage_mm for r in row])
            order = np.argsort(target[:, 0])
            errors.append(at[:, 2] - CubicSpline(target[order, 0], target[order, 2])(at[:, 0]))
        return float(1e3 * np.percentile(np.abs(np.concatenate(errors)), share))


def technique(mode: str, step_mm: float, margin_mm: float = 3.0) -> Technique:
    base = Technique()
    plan = base.plan.model_copy(update={"pitch_mm": step_mm, "step_mm": step_mm, "margin_mm": margin_mm})
    return base.model_copy(update={"plan": plan, "scan": base.scan.model_copy(update={"mode": mode})})


def lower_bound_s(plan: ScanPlan, acceleration_mm_s2: float) -> float:
    """Return row length / speed plus the turns: links and approaches at their planned speeds, rest to rest."""
    at = plan.T_part_probe[:, :3, 3]
    length = np.linalg.norm(np.diff(at, axis=0), axis=1)
    along = plan.is_scan[1:] & plan.is_scan[:-1]
    rows = float((length[along] / plan.speed_mm_s[1:][along]).sum())
    turns = [
        rest_to_rest_s(float(d), float(v), acceleration_mm_s2)
        for d, v in zip(length[~along], plan.speed_mm_s[1:][~along], strict=True)
        if d > 0
    ]
    return rows + sum(turns)


def first_rows(plan: ScanPlan, rows: int) -> ScanPlan:
    """Return the plan's first rows with the poses that lead to them."""
    keep = plan.row < rows
    arrays = {f.name: getattr(plan, f.name) for f in fields(plan) if isinstance(getattr(plan, f.name), np.ndarray)}
    return replace(plan, **{name: values[keep] for name, values in arrays.items()})


def scan_block(
    part: str,
    mode: str,
    *,
    step_mm: float = 5.0,
    margin_mm: float = 3.0,
    clock: Clock | None = None,
    reply_delay_s: float = 0.001,
    acceleration: float = 200.0,
    rows: int | None = None,
    seed: int = 1,
) -> Outcome:
    """Scan a block in "step" or "row" on the study's chain, in "pvt" on a multi-axis controller."""
    from eddyscan.devices.drivers.zaber import ZaberStage

    clock, layout = clock or VirtualClock(), "mcc" if mode == "pvt" else "chain"
    axes = tuple(axis.model_copy(update={"acceleration": acceleration}) for axis in STUDY_AXES)
    settings = ZaberSettings(layout=layout, axes=axes, reply_delay_s=reply_delay_s, seed=seed)
    simulator = ZaberSimulator(settings, clock)
    host, port = simulator.start()
    wired = STUDY_CHAIN
    if layout == "mcc":
        wired = tuple(axis.model_copy(update={"device": 1, "axis": n}) for n, axis in enumerate(STUDY_CHAIN, 1))
    stage = ZaberStage(ZaberStageSettings(host=host, port=port, axes=wired, dead_man=False), clock)
    given = technique(mode, step_mm, margin_mm)
    plan = make_plan(named_part(part).top_mesh(1.0), given)
    if rows is not None:
        plan = first_rows(plan, rows)
    instrument, sink = LiftOffInstrument(clock, simulator, part, seed), MemorySink()
    try:
        stage.home()
        wall, began = time.perf_counter(), clock.now()
        where = {"stage": stage, "instrument": instrument, "clock": clock, "sink": sink}
        run(plan, **where, technique=given, T_stage_part=T_STAGE_PART)
        took, wall = clock.now() - began, time.perf_counter() - wall
    finally:
        stage.close()
        simulator.close()
    true = _true_at(sink.readings, instrument)
    return Outcome(plan, sink.readings, true, took, lower_bound_s(plan, acceleration), wall, sink.notes.get("latency"))


def _true_at(readings: list[Reading], instrument: LiftOffInstrument) -> Array:
    """Return the true positions of the readings: the nearest of all reads to each, in order."""
    true, out, k = instrument.true_mm, [], 0
    for reading in readings:
        while np.abs(true[k] - np.array(reading.stage_mm)).max() > 1.0:
            k += 1
        out.append(true[k])
        k += 1
    return np.array(out)
