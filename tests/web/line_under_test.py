"""A stand-in for the pipeline's steps, run by the worker: it obeys behave.json and never touches a device."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.errors import InputError, MotionError
from eddyscan.core.record import Reading
from eddyscan.formats.plans import read_plan
from eddyscan.formats.records import SqliteRecord
from eddyscan.inspection import Inspection, write_json, write_step_note
from eddyscan.pipeline.control import ScanControl, WatchedSink
from eddyscan.pipeline.states import inputs_of


class PretendStage:
    """Notes when it was stopped."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def stop(self) -> None:
        with (self._folder / "stops.txt").open("a") as file:
            file.write(f"{time.monotonic()}\n")


def single_step(
    folder: Path, step: str, *, progress: Any, control: ScanControl, dry_run: bool = False, **_: Any
) -> dict[str, Any]:
    """Do as behave.json says."""
    path = folder / "behave.json"
    how = json.loads(path.read_text()) if path.is_file() else {}
    if how.get("die"):
        os._exit(7)
    if how.get("refuse"):
        raise InputError("coverage is 40 %, the technique demands 95 %. Lower the pitch.")
    if how.get("break"):
        raise ZeroDivisionError("a fault nobody foresaw")
    if step == "record" and not dry_run:
        return _scan(Inspection(folder), progress, control, how)
    for k in range(how.get("ticks", 3)):
        progress("working", k, how.get("ticks", 3))
        time.sleep(how.get("tick_s", 0.02))
    return {"warnings": ["the second view hangs loosely"] if how.get("warn") else []}


def _scan(inspection: Inspection, progress: Any, control: ScanControl, how: dict[str, Any]) -> dict[str, Any]:
    from datetime import UTC, datetime

    started = datetime.now(UTC)
    folder = inspection.step_folder("record")
    folder.mkdir(exist_ok=True)
    write_json(folder / "alignment.json", {"T_stage_part": np.eye(4).tolist(), "how": "as told"})
    write_json(folder / "inputs.json", inputs_of(inspection, "record"))
    control.attach(PretendStage(inspection.folder))
    keys = _points(inspection, how)
    for number in range(how.get("passes", 1)):
        sink = WatchedSink(SqliteRecord(folder / "record.sqlite", scan_pass=number), control)
        _follow(keys, sink, progress, control, how)
    write_step_note(folder, inputs_of(inspection, "record"), started)
    return {}


def _follow(keys: list[Any], sink: WatchedSink, progress: Any, control: ScanControl, how: dict[str, Any]) -> None:
    done = sink.done()
    left = [(number, *key) for number, key in enumerate(keys) if key[:2] not in done]
    batch = how.get("batch", 1)
    try:
        for first in range(0, len(left), batch):
            progress("scan", first, len(left))
            if control.stopped:
                raise MotionError("the stage was stopped on request. Check the probe, then move again.")
            sink.write([_reading(*key) for key in left[first : first + batch]])
            time.sleep(how.get("interval_s", 0.005))
    finally:
        sink.close()


def _points(inspection: Inspection, how: dict[str, Any]) -> list[tuple[int, int, np.ndarray]]:
    plan = read_plan(inspection.file("plan", "plan.json"))
    scan = np.flatnonzero(plan.is_scan)
    real = [(int(plan.row[k]), int(plan.point[k]), plan.T_part_probe[k, :3, 3]) for k in scan]
    more = how.get("readings", len(real)) - len(real)
    return real + [(1000 + k // 1000, k % 1000, real[k % len(real)][2]) for k in range(max(0, more))]


def _reading(number: int, row: int, point: int, at: np.ndarray) -> Reading:
    where = (float(at[0]), float(at[1]), float(at[2]))
    impedance = complex(1.3 + 0.2 * np.sin(number / 9), 37 + np.cos(number / 17))
    return Reading(row, point, 0.1 * number, where, 5e5, impedance, 0, where)
