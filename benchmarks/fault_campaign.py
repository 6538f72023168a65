"""Scans that are killed, cut off and stalled at random moments, and what is left of them each time."""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from eddyscan.core.errors import EddyscanError
from eddyscan.core.parts import named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.devices.clock import ScaledClock, VirtualClock
from eddyscan.devices.drivers.zaber_settings import STUDY_CHAIN, ZaberStageSettings
from eddyscan.devices.protocols import Clock, Identity, ImpedanceReading
from eddyscan.devices.sim.zaber import Fault, ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.formats.records import SqliteRecord, read_record
from eddyscan.planning import plan as make_plan

PART, T_STAGE_PART = "block-a", np.array([[1.0, 0, 0, 1.0], [0, 1, 0, 50.0], [0, 0, 1, -8.0], [0, 0, 0, 1.0]])
KINDS = ("drop-link", "garble", "silence", "delay", "stall", "driver-off", "power-cycle")
FASTER = 15.0
REST_S = 1.5  # of the stage's clock
LATEST_REST_S = 0.5  # wall time after a kill; homing or crossing the part would take longer to end by itself


class SteadyInstrument:
    """Reads the same value every time: the campaign looks at the stage and the record alone."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def identity(self) -> Identity:
        return Identity("steady", "benchmark", "1")

    def configure(self, drive: object) -> None: ...

    def read(self) -> ImpedanceReading:
        self._clock.sleep(0.006)
        z = 100.0 + 50j * np.exp(-((self._clock.now() % 0.7) ** 2))
        return ImpedanceReading(complex(z), self._clock.now())

    def close(self) -> None: ...


def technique(mode: str) -> Technique:
    base = Technique()
    plan = base.plan.model_copy(update={"pitch_mm": 30.0, "step_mm": 15.0})
    return base.model_copy(update={"plan": plan, "scan": base.scan.model_copy(update={"mode": mode, "watch_rows": 0})})


@lru_cache(maxsize=1)
def coarse_plan() -> ScanPlan:
    return make_plan(named_part(PART).top_mesh(2.0), technique("step"))


def stage_settings(host: str, port: int, layout: str, *, timeout_s: float, dead_man: bool) -> ZaberStageSettings:
    axes = STUDY_CHAIN
    if layout == "mcc":
        axes = tuple(axis.model_copy(update={"device": 1, "axis": n}) for n, axis in enumerate(STUDY_CHAIN, 1))
    return ZaberStageSettings(host=host, port=port, axes=axes, request_timeout_s=timeout_s, dead_man=dead_man)


def scan(address: tuple[str, int, str], record: Path, mode: str, clock: Clock, *, alone: bool) -> None:
    """Run (or go on with) the scan; `alone`: in a process of its own, with its dead man."""
    from eddyscan.devices.drivers.zaber import ZaberStage
    from eddyscan.scanning import run

    stage = ZaberStage(stage_settings(*address, timeout_s=1.0 if alone else 0.25, dead_man=alone), clock)
    sink = SqliteRecord(record)
    try:
        run(
            coarse_plan(),
            stage=stage,
            instrument=SteadyInstrument(clock),
            clock=clock,
            sink=sink,
            technique=technique(mode),
            T_stage_part=T_STAGE_PART,
        )
    finally:
        sink.close()
        stage.close()


def child(address: tuple[str, int, str], record: str, mode: str) -> None:
    from zaber_motion import Library

    Library.enable_device_db_store(tempfile.gettempdir() + "/eddyscan-zaber-store")
    from eddyscan.scanning import latency

    latency.LARGEST_UNCERTAINTY_S = float("inf")  # a steady instrument tells nothing about delay
    scan(address, Path(record), mode, ScaledClock(FASTER), alone=True)


@dataclass
class Outcome:
    """What a campaign found; every count but `faults` and `finished` must be 0."""

    faults: int = 0
    finished: int = 0
    lost: int = 0
    doubled: int = 0
    rewritten: int = 0
    moving: int = 0
    into_part: int = 0
    worst_clearance_mm: float = float("inf")
    slowest_rest_s: float = 0.0
    unexpected: Counter[str] = field(default_factory=Counter)
    told: Counter[str] = field(default_factory=Counter)

    def clean(self) -> bool:
        bad = self.lost + self.doubled + self.rewritten + self.moving + self.into_part
        return bad == 0 and not self.unexpected


def look_at_stage(simulator: ZaberSimulator, outcome: Outcome) -> None:
    """Note whether the axes rest and whether the coil stands clear of the part."""
    outcome.moving += int(simulator.moving())
    at = simulator.true_position()[:3] - T_STAGE_PART[:3, 3]
    if 0 < at[0] < 200 and 0 < at[1] < 100:
        clearance = float(at[2] - (30.0 + 7.5 * np.sin(2 * np.pi * at[0] / 150.0)))
        outcome.worst_clearance_mm = min(outcome.worst_clearance_mm, clearance)
        outcome.into_part += int(clearance < 0.0)


def look_at_record(record: Path, before: list[tuple[object, ...]], outcome: Outcome) -> list[tuple[object, ...]]:
    """Check that nothing recorded earlier changed and no point came twice; return what is there now."""
    if not record.exists():
        return []
    held = read_record(record)
    rows = [
        (int(r), int(p), float(t), complex(z))
        for r, p, t, z in zip(held.row, held.point, held.time_s, held.impedance_ohm, strict=True)
    ]
    outcome.rewritten += int(rows[: len(before)] != before)
    outcome.doubled += len(rows) - len({row[:2] for row in rows})
    return rows


def finish(plan: ScanPlan, rows: list[tuple[object, ...]], outcome: Outcome) -> None:
    """Check that every planned point has its reading."""
    wanted = {(int(r), int(p)) for r, p in zip(plan.row[plan.is_scan], plan.point[plan.is_scan], strict=True)}
    outcome.lost += len(wanted - {row[:2] for row in rows})
    outcome.finished += 1


def kill_campaign(kills: int, seed: int, folder: Path, modes: tuple[str, ...] = ("step", "row", "pvt")) -> Outcome:
    """Kill the scanning process at random moments; go on after each kill until the plan is done."""
    rng, outcome, plan = np.random.default_rng(seed), Outcome(), coarse_plan()
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["benchmarks.fault_campaign", "eddyscan.scanning"])
    turn = 0
    while outcome.faults < kills:
        mode = modes[turn % len(modes)]
        layout = "mcc" if mode == "pvt" else "chain"
        simulator = ZaberSimulator(ZaberSettings(layout=layout), ScaledClock(FASTER))
        host, port = simulator.start()
        record, rows = folder / f"kill-{turn}.sqlite", []
        turn += 1
        while True:
            process = context.Process(target=child, args=((host, port, layout), str(record), mode), daemon=True)
            process.start()
            if outcome.faults < kills:
                _wait_for_motion(simulator, process)
                process.join(float(rng.uniform(0.0, 1.5)))
            else:
                process.join(120.0)
            alive = process.is_alive()
            process.kill()
            process.join()
            outcome.faults += int(alive)
            _wait_for_rest(simulator, outcome)
            look_at_stage(simulator, outcome)
            rows = look_at_record(record, rows, outcome)
            if not alive:
                break
        if process.exitcode != 0:
            outcome.unexpected[f"child ended with {process.exitcode}"] += 1
        finish(plan, rows, outcome)
        simulator.close()
    return outcome


def _wait_for_motion(simulator: ZaberSimulator, process: multiprocessing.Process) -> None:
    """Wait until the child commands the stage: a kill during start-up proves nothing."""
    seen = simulator.commands_seen
    while process.is_alive() and simulator.commands_seen < seen + 40:
        time.sleep(0.01)


def _wait_for_rest(simulator: ZaberSimulator, outcome: Outcome) -> None:
    """Wait until the axes rest, at most LATEST_REST_S; keep the longest wait."""
    killed = time.monotonic()
    while simulator.moving() and time.monotonic() - killed < LATEST_REST_S:
        time.sleep(0.002)
    outcome.slowest_rest_s = max(outcome.slowest_rest_s, time.monotonic() - killed)


def link_campaign(faults: int, seed: int, folder: Path, modes: tuple[str, ...] = ("step", "row", "pvt")) -> Outcome:
    """Let one fault happen at a random command of a scan; go on after each until the plan is done."""
    from eddyscan.scanning import latency

    rng, outcome, plan = np.random.default_rng(seed), Outcome(), coarse_plan()
    usual, latency.LARGEST_UNCERTAINTY_S = latency.LARGEST_UNCERTAINTY_S, float("inf")
    turn = 0
    try:
        while outcome.faults < faults:
            _one_scan_with_faults(turn, faults, modes[turn % len(modes)], rng, outcome, folder, plan)
            turn += 1
    finally:
        latency.LARGEST_UNCERTAINTY_S = usual
    return outcome


def _one_scan_with_faults(
    turn: int, most: int, mode: str, rng: np.random.Generator, outcome: Outcome, folder: Path, plan: ScanPlan
) -> None:
    layout = "mcc" if mode == "pvt" else "chain"
    clock = VirtualClock()
    simulator = ZaberSimulator(ZaberSettings(layout=layout), clock)
    address = (*simulator.start(), layout)
    record, rows = folder / f"link-{turn}.sqlite", []
    try:
        while len(rows) < plan.n_scan:
            simulator.faults.clear()
            if outcome.faults < most:
                simulator.inject(_any_fault(rng))
                outcome.faults += 1
            try:
                scan(address, record, mode, clock, alone=False)
            except EddyscanError as fault:
                outcome.told[type(fault).__name__] += 1
            except Exception as fault:
                outcome.unexpected[repr(fault)[:120]] += 1
            simulator.faults.clear()
            clock.sleep(REST_S)
            look_at_stage(simulator, outcome)
            rows = look_at_record(record, rows, outcome)
            _repair(simulator)
        finish(plan, rows, outcome)
    finally:
        simulator.close()


def _any_fault(rng: np.random.Generator) -> Fault:
    return Fault(
        KINDS[int(rng.integers(len(KINDS)))],
        after=int(rng.integers(30, 1500)),
        count=int(rng.integers(1, 4)),
        axis="xyz"[int(rng.integers(3))],
        delay_s=float(rng.uniform(0.1, 1.0)),
    )


def _repair(simulator: ZaberSimulator) -> None:
    """Do what a person would: enable the drivers, clear the flags, home again if the reference is gone."""
    simulator.answer(b"/0 0 driver enable\n")
    simulator.answer(b"/0 0 warnings clear\n")
