"""Cases for tests of the engine, importable on workers; as a program, the small campaign in a process to be killed."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

Rows = list[dict[str, Any]]


def square_rows(shared: int, batch: Sequence[Mapping[str, Any]]) -> Rows:
    """Return shared times the square of the case's number."""
    return [{"case": case["case"], "value": shared * case["case"] ** 2} for case in batch]


def slow_rows(seconds: float, batch: Sequence[Mapping[str, Any]]) -> Rows:
    """Return the case's number after a while."""
    time.sleep(seconds)
    return [{"case": case["case"]} for case in batch]


def lethal_rows(shared: None, batch: Sequence[Mapping[str, Any]]) -> Rows:
    """End the worker's process."""
    os._exit(1)


def main(file: Path, out: Path) -> None:
    """Run a campaign with coarse crack tables and one row per part."""
    from eddyscan.campaign import engine, library
    from eddyscan.campaign.run import run_campaign

    library.ALONG, library.ACROSS, library.HEIGHTS = 9, 9, 4
    engine.MAX_BATCH = 1
    run_campaign(file, out)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
