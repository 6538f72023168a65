"""Times every step of the line and the reference study's method beside it, in one run.

python -m benchmarks.line [--part block-a] [--seed 1] [--picture]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.validation_page import PICTURES, write_section
from eddyscan import pipeline
from eddyscan.inspection import Inspection


def timed(work: Callable[[], Any]) -> tuple[float, float, Any]:
    """Return wall seconds, CPU seconds and the result."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return time.perf_counter() - wall, time.process_time() - cpu, result


def study_surface(folder: Path, part: str) -> dict[str, Any]:
    """Run the study's literal chain on the same views and compare it with the nominal."""
    views = Inspection(folder).view_files()
    settings = pipeline.surface_settings(None, {"method": "study"})
    wall, cpu, result = timed(lambda: pipeline.surface_from_views(views, folder / "study", settings))
    deviation = pipeline.compare_meshes(folder / "study" / "surface.ply", part)
    return {"wall_s": wall, "cpu_s": cpu, "result": result, "deviation": deviation}


def run_line(folder: Path, part: str, seed: int) -> list[list[str]]:
    """Return the table's rows: step, ours, study."""
    pipeline.new_inspection(folder, part=part, seed=seed)
    rows = []
    steps = {
        "views": "views",
        "surface": "surface",
        "plan": "plan",
        "record": "scan",
        "cscan": "C-scan",
        "report": "report",
    }
    for step, words in steps.items():
        wall, cpu, summary = timed(lambda step=step: pipeline.single_step(folder, step))
        rows.append([f"{words}: wall / CPU s", f"{wall:.2f} / {cpu:.2f}", "-"])
    study = study_surface(folder, part)
    rows[1][2] = f"{study['wall_s']:.2f} / {study['cpu_s']:.2f}"
    points = summary["plan"]["points"]
    rows[3][2] = f"{2.0 * points:.0f} (2 s pause at each of {points} points, computed)"
    ours = summary["truth"]["surface"]
    for frame in ("own", "fit"):
        theirs = study["deviation"][frame]
        rows.append(
            [
                f"surface error, {frame} frame: mean / RMSE / p95 mm",
                " / ".join(f"{ours[frame][key]:.3f}" for key in ("mean_abs_mm", "rmse_mm", "p95_mm")),
                " / ".join(f"{theirs[key]:.3f}" for key in ("mean_abs_mm", "rmse_mm", "p95_mm")),
            ]
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", default="block-a")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="write the section of docs/validation.md")
    parser.add_argument("--picture", action="store_true", help="draw docs/pictures/line-PART.png from the run")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "line"
        rows = run_line(folder, options.part, options.seed)
        if options.picture:
            from benchmarks.line_picture import draw

            draw(folder, PICTURES / f"line-{options.part}.png")
    table = Table("step", "eddyscan", "the study's method", title=f"{options.part}, seed {options.seed}")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
    if options.write:
        lines = [
            "| step | eddyscan | the study's method, rebuilt |",
            "|---|---|---|",
            *("| " + " | ".join(r) + " |" for r in rows),
        ]
        command = f"    python -m benchmarks.line --part {options.part} --seed {options.seed} --write\n\n"
        write_section("line", "The whole line, timed", command + "\n".join(lines))


if __name__ == "__main__":
    main()
