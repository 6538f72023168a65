"""One step over many inspection folders: failures are collected and named, the others unharmed."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from eddyscan.campaign.engine import run_batches
from eddyscan.core.errors import InputError
from eddyscan.core.progress import Progress, silent

BATCH_STEPS = ("surface", "plan", "cscan", "report", "run")
WORDS = {"analyse": "cscan"}


def run_batch(
    step: str,
    folders: Sequence[Path],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress = silent,
) -> list[dict[str, Any]]:
    """Do a step in every folder and return one row per folder: folder, ok, seconds, error.

    Raises InputError for an unknown step or no folder. A step that moves a stage
    is not offered: motion has one owner and one rig.
    """
    name = WORDS.get(step, step)
    if name not in BATCH_STEPS:
        offered = ", ".join(("analyse" if other == "cscan" else other) for other in BATCH_STEPS)
        raise InputError(f"batch cannot do {step!r}; it does {offered}.")
    if not folders:
        raise InputError("batch needs at least one inspection folder.")
    cases = [{"case": number, "folder": str(folder)} for number, folder in enumerate(folders)]
    rows: list[dict[str, Any]] = []
    for finished in run_batches(do_batch, name, cases, workers=workers, scheduler=scheduler):
        rows += finished
        progress(f"batch {step}", len(rows), len(cases))
    return sorted(rows, key=lambda row: int(row["case"]))


def do_batch(step: str, cases: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Do the step in these folders, one after the other."""
    return [_do_folder(step, case) for case in cases]


def _do_folder(step: str, case: Mapping[str, Any]) -> dict[str, Any]:
    from eddyscan import pipeline

    started = time.perf_counter()
    error = ""
    try:
        if step == "run":
            pipeline.run(Path(case["folder"]))
        else:
            pipeline.single_step(Path(case["folder"]), step)
    except Exception as fault:  # whatever it is, it is this folder's alone
        error = f"{type(fault).__name__}: {fault}"
    seconds = round(time.perf_counter() - started, 3)
    return {"case": case["case"], "folder": case["folder"], "ok": not error, "seconds": seconds, "error": error}
