"""Stop on the page until the axes rest: `python -m benchmarks.page_stop [--trials N]`.

Every trial starts a move of the simulated Zaber stage at 25 mm/s in life time, through
the same door, worker and driver as a scan, and sends Stop as the page does. Noted are
when the simulated controller takes the command (its axes brake from then on) and when its
true axes rest, seen at 1 kHz in the worker; all ends read the system's monotonic clock.
Load: two processes that compute all the time per core, two pages with the live wire, one page
that asks for the largest scene again and again.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import multiprocessing
import os
import random
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

BAR_MS = 100.0
SPEED_MM_S = 25.0
SEED = 8
BRAKE_MM_S2 = 200.0
kept: dict[str, Any] = {}


def single_step(folder: Path, _step: str, *, progress: Any, control: Any, **_: Any) -> dict[str, Any]:
    """Move the stage to and fro until Stop; called by the page's worker in place of the scan."""
    rig = kept.get("rig") or kept.setdefault("rig", opened())
    rested: list[float] = []
    watcher = threading.Thread(target=watch, args=(rig.cell.stage, control, rested), daemon=True)
    progress("moving", 0, 1)
    control.attach(rig.stage)
    watcher.start()
    (folder / "moving").touch()
    try:
        for k in range(1000):
            rig.stage.move(np.array([190.0 if k % 2 else 10.0, 100.0, 20.0]), SPEED_MM_S)
    finally:
        watcher.join(10)
        (folder / "rested.json").write_text(json.dumps(rested))
    return {}


def opened() -> Any:
    """Open the virtual cell in life time and home its stage."""
    from eddyscan.devices.rig import open_rig, virtual_rig

    settings = virtual_rig()
    settings = settings.model_copy(update={"world": settings.world.model_copy(update={"time_factor": 1.0})})
    rig = open_rig(settings).__enter__()
    rig.stage.home()
    axis = rig.cell.stage.axes[0]
    brake = axis.stop

    def noted(*arguments: Any) -> None:
        kept["braked"] = time.monotonic()
        brake(*arguments)

    axis.stop = noted
    return rig


def watch(stage: Any, control: Any, rested: list[float]) -> None:
    """Note when the true axes rest after Stop; moving when it came is a condition of the trial."""
    while not control.stopped:
        time.sleep(0.001)
    began_moving = bool(stage.moving())
    while stage.moving():
        time.sleep(0.001)
    rested.extend([time.monotonic(), float(began_moving), kept["braked"]])


def burn() -> None:
    """Keep a core busy."""
    value = 0
    while True:
        value = (value * 31 + 7) % 1_000_003


async def trials(count: int, folder: Path) -> tuple[list[float], list[float]]:
    """Return milliseconds from Stop to the brakes, and to rest."""
    from tornado.websocket import websocket_connect

    from eddyscan.web.door import open_door
    from tests.web.shelf_on_disk import planned_inspection

    inspection = planned_inspection(folder / "stop", part="block-a", pitch_mm=5.0, step_mm=5.0)
    running = await open_door(folder, line="benchmarks.page_stop")
    bench, access = running.door.bench, running.door.access
    offered = ["eddyscan", access.operator_token]
    pages = [await websocket_connect(f"ws://127.0.0.1:{access.port}/live", subprotocols=offered) for _ in range(2)]
    readers = [asyncio.ensure_future(drain(page)) for page in pages]
    asking = asyncio.ensure_future(ask_for_ever(running.door.library))
    chance, to_rest, to_brake = random.Random(SEED), [], []
    while len(to_rest) < count:
        (inspection.folder / "moving").unlink(missing_ok=True)
        (inspection.folder / "rested.json").unlink(missing_ok=True)
        await bench.run(inspection.folder, ["record"])
        while not (inspection.folder / "moving").exists():
            await asyncio.sleep(0.02)
        await asyncio.sleep(0.4 + 1.5 * chance.random())
        pressed = time.monotonic()
        await pages[0].write_message(json.dumps({"do": "stop"}))
        while bench.job is not None and bench.job.active:
            await asyncio.sleep(0.02)
        rested = json.loads((inspection.folder / "rested.json").read_text())
        if rested and rested[1]:
            to_rest.append(1e3 * (rested[0] - pressed))
            to_brake.append(1e3 * (rested[2] - pressed))
    for task in (asking, *readers):
        task.cancel()
    await running.close()
    return to_brake, to_rest


async def drain(page: Any) -> None:
    """Read a page's news."""
    while await page.read_message() is not None:
        pass


async def ask_for_ever(library: Any) -> None:
    """Keep the library at its heaviest question."""
    while True:
        await library.ask("scene", name="stop", scene="plan")
        await library.ask("overview", name="stop")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--write", action="store_true", help="write the section of docs/validation.md")
    options = parser.parse_args()
    cores = os.cpu_count() or 1
    rows = []
    for load in (0, 2 * cores):
        burning = [multiprocessing.Process(target=burn, daemon=True) for _ in range(load)]
        for process in burning:
            process.start()
        try:
            with TemporaryDirectory() as folder:
                to_brake, to_rest = asyncio.run(trials(options.trials, Path(folder)))
        finally:
            for process in burning:
                process.terminate()
        rows.append((load, to_brake, to_rest))
    text = table(rows, cores)
    print(text)
    if options.write:
        from benchmarks.validation_page import write_section

        write_section("page-stop", "Stop on the page until the axes rest", text)


def table(rows: list[tuple[int, list[float], list[float]]], cores: int) -> str:
    """Return the result as Markdown."""
    lines = [
        f"`python -m benchmarks.page_stop --trials {len(rows[0][1])}` ({cores} shared cores, seed {SEED}). "
        f"Moving at {SPEED_MM_S:g} mm/s. Bar: {BAR_MS:g} ms at the 99th percentile. The simulated axes brake with "
        f"{BRAKE_MM_S2:g} mm/s² (a placeholder), so they need {1e3 * SPEED_MM_S / BRAKE_MM_S2:.0f} ms to rest "
        "however fast the command comes.",
        "",
        "| computing processes besides | trials | brakes: median ms | p95 | p99 | rest: median ms | p99 |",
        "|---|---|---|---|---|---|---|",
    ]
    for load, to_brake, to_rest in rows:
        brake, rest = np.percentile(to_brake, [50, 95, 99]), np.percentile(to_rest, [50, 99])
        cells = [str(load), str(len(to_rest)), *(f"{value:.0f}" for value in (*brake, *rest))]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
