"""Scanning: time against the lower bound, smear, following error, overhead, beside the study's stop and go.

    python -m benchmarks.scanning [--fine] [--write]

Runs in the virtual cell on virtual time, so the figures do not depend on the
computer's load; the overhead per point is measured on wall time.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time

import numpy as np

from benchmarks.scanning_cell import Outcome, scan_block
from benchmarks.validation_page import write_section
from eddyscan.devices.clock import VirtualClock, WallClock
from eddyscan.devices.drivers.zaber_settings import ZaberStageSettings
from eddyscan.devices.sim.zaber import ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.devices.trapezoid import rest_to_rest_s

STUDY_PAUSE_S = 2.0
SERIAL_S = 0.0043


def study_time_s(outcome: Outcome) -> float:
    """Return how long the study's loop takes on the same points: the same moves and two seconds at each."""
    return outcome.duration_s + STUDY_PAUSE_S * len(outcome.readings)


def line(what: str, required: str, measured: str) -> str:
    return f"| {what} | {required} | {measured} |"


def told(outcome: Outcome) -> str:
    lost, doubled = outcome.lost_doubled()
    return (
        f"{outcome.ratio:.3f} ({outcome.duration_s:.0f} s against {outcome.bound_s:.0f} s; {len(outcome.readings)} "
        f"readings, {lost} lost, {doubled} doubled)"
    )


def coarse() -> list[str]:
    step, row, pvt = (scan_block("block-a", mode) for mode in ("step", "row", "pvt"))
    slow = scan_block("block-a", "step", acceleration=100.0)
    study = study_time_s(step) / step.bound_s
    rows = [
        line("block-a, 5 mm: the study's 2 s per point, over the bound", "-", f"{study:.1f}"),
        line("block-a, 5 mm, step, over the bound", "<= 2.0", told(step)),
        line("the same with axes of 100 instead of 200 mm/s2", "-", told(slow)),
        line("block-a, 5 mm, row (chain), over the bound", "<= 1.15", told(row)),
        line("block-a, 5 mm, pvt (controller), over the bound", "<= 1.15", told(pvt)),
    ]
    for name, outcome in (("row", row), ("pvt", pvt)):
        assert outcome.latency is not None
        delay = f"{1e3 * outcome.latency['seconds']:.2f} +- {1e3 * outcome.latency['uncertainty_s']:.2f} ms"
        rows.append(line(f"smear at 25 mm/s, {name}", "<= 0.05 mm", f"{outcome.smear_mm():.4f} mm (latency {delay})"))
    return rows


def steep() -> list[str]:
    rows = []
    for what, mode, delay, limit in (
        ("row, network", "row", 0.001, 60),
        ("row, serial line at 115200 baud", "row", SERIAL_S, 60),
        ("pvt", "pvt", 0.001, 30),
    ):
        outcome = scan_block("block-c", mode, reply_delay_s=delay)
        measured = f"{outcome.z_following_um():.1f} um (smear {outcome.smear_mm():.3f} mm)"
        rows.append(line(f"block-c, 25 mm/s, z off the path, 95 %, {what}", f"<= {limit} um", measured))
    return rows


def fine() -> list[str]:
    rows = []
    for mode in ("row", "pvt"):
        outcome = scan_block("block-a", mode, step_mm=1.0, margin_mm=0.5)
        rows.append(
            line(f"block-a, 1 mm at 25 mm/s, {mode}, over the bound", "<= 1.15, 20 000+, 0 lost", told(outcome))
        )
    return rows


def on_the_wall_clock() -> list[str]:
    """Drive two rows of block-c at life speed: what the computer's own hesitation adds."""
    rows = []
    for mode, limit in (("row", 60), ("pvt", 30)):
        outcome = scan_block("block-c", mode, rows=2, clock=WallClock())
        measured = f"{outcome.z_following_um():.1f} um, smear {outcome.smear_mm():.3f} mm, {told(outcome)}"
        rows.append(line(f"block-c, 2 rows on the wall clock, {mode}: z off the path", f"<= {limit} um", measured))
    return rows


def overhead_ms(points: int = 60) -> tuple[float, float]:
    """Return (scan loop's overhead per stepped point, part of it spent on the wire) [ms], medians on wall time.

    The stage's own time is the move's trapezoid; settling and reading take no
    time here. One move of 0.5 mm along x and one reading of all axes per point.
    """
    from eddyscan.devices.drivers.zaber import ZaberStage

    clock = WallClock()
    simulator = ZaberSimulator(ZaberSettings(reply_delay_s=0.0), clock)
    host, port = simulator.start()
    stage = ZaberStage(ZaberStageSettings(host=host, port=port, dead_man=False), clock)
    try:
        _home_at_once(simulator)
        stage.position()
        axis = stage.axes()[0]
        own = rest_to_rest_s(0.5, axis.max_speed, axis.acceleration)
        moves, asks = [], []
        for k in range(points):
            target = stage.position()
            target[0] = 50.0 + 0.5 * (k % 2)
            began = time.perf_counter()
            stage.move(target)
            moved = time.perf_counter()
            stage.position()
            moves.append(time.perf_counter() - began - own)
            asks.append((time.perf_counter() - moved) / 3)
    finally:
        stage.close()
        simulator.close()
    return 1e3 * statistics.median(moves[2:]), 1e3 * statistics.median(asks[2:])


def _home_at_once(simulator: ZaberSimulator) -> None:
    """Give the simulated axes their reference without waiting for the drive home."""
    clock, simulator.clock = simulator.clock, VirtualClock(simulator.clock.now())
    simulator.answer(b"/0 0 home\n")
    simulator.clock.sleep(30.0)
    simulator.answer(b"/0 0 move abs 1000000\n")
    simulator.clock.sleep(30.0)
    simulator.answer(b"/\n")
    simulator.clock = clock


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--fine", action="store_true", help="also the 1 mm raster (20 000 readings) and rows at life speed"
    )
    parser.add_argument("--write", action="store_true", help="write the section of docs/validation.md")
    given = parser.parse_args()
    from zaber_motion import Library

    with tempfile.TemporaryDirectory() as store:
        Library.enable_device_db_store(store)
        total, ask = min(overhead_ms() for _ in range(5))  # a busy computer only ever adds
        rows = [
            *coarse(),
            *(fine() if given.fine else []),
            *steep(),
            *(on_the_wall_clock() if given.fine else []),
            line(
                "overhead per stepped point over the stage's own time",
                "<= 5 ms",
                f"{total:.1f} ms (one request {ask:.2f})",
            ),
        ]
    body = "    python -m benchmarks.scanning --fine\n\n| | required | measured |\n|---|---|---|\n" + "\n".join(rows)
    body += (
        "\n\nVirtual cell with the vendor's library over TCP; speeds (29, 29, 24 mm/s) and accelerations (200 mm/s2) "
        "of the simulated axes are placeholders. The lower bound is row length over speed plus every link and approach "
        "at its planned speed from rest to rest. Smear: recorded minus true position, rows there minus rows back. "
        "Seed 1.\n"
    )
    print(body)
    if given.write:
        write_section("scanning", "Scanning: time, smear, following error", body)


if __name__ == "__main__":
    np.seterr(all="raise", under="ignore")
    main()
