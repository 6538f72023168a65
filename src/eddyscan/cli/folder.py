"""Commands on an inspection folder: demo, new, run and the single steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from eddyscan.cli.terminal import emit_json, progress_bars, say, table

Json = typer.Option(False, "--json", help="Print one JSON object on standard output.")
RigFile = typer.Option(None, "--rig", help="rig.toml of a real rig; the virtual cell without it.")
Arm = typer.Option(False, "--arm", help="Allow a real rig to move; needed every time.")
Folder = typer.Argument(..., help="The inspection folder.", metavar="DIR")


def register(app: typer.Typer) -> None:
    """Add this module's commands."""
    app.command()(demo)
    app.command()(new)
    app.command()(run)
    app.command()(scan)
    app.command()(analyse)
    app.command()(report)
    app.command()(status)


def demo(
    part: str = typer.Option("block-a", "--part", help="Named part: block-a to block-d, dome, blade, plate."),
    seed: int = typer.Option(1, "--seed", help="Seed of the virtual cell's hidden pose, flaws and noise."),
    out: Path = typer.Option(Path("inspections/demo"), "--out", help="Inspection folder to make.", metavar="DIR"),
    json: bool = Json,
) -> None:
    """Inspect a part in the virtual cell from views to report."""
    from eddyscan import pipeline

    with progress_bars() as progress:
        summary = pipeline.demo(out, part=part, seed=seed, progress=progress)
    _tell(summary, json)


def new(
    folder: Path = Folder,
    part: str = typer.Option("block-a", "--part", help="Named part for the virtual cell and the comparison."),
    seed: int = typer.Option(1, "--seed", help="Seed of the virtual cell."),
    json: bool = Json,
) -> None:
    """Make a new inspection folder with a commented technique.toml and rig.toml."""
    from eddyscan import pipeline

    inspection = pipeline.new_inspection(folder, part=part, seed=seed)
    say(f"made {inspection.folder} with technique.toml and rig.toml; put views into 1-views/ or let the rig take them.")
    say(f"next: eddyscan run {inspection.folder}")
    if json:
        emit_json({"folder": str(inspection.folder), "part": part, "seed": seed})


def run(
    folder: Path = Folder, rig: Path | None = RigFile, arm: bool = Arm, dry_run: bool = False, json: bool = Json
) -> None:
    """Do every step that is missing or stale; after a crash, go on where it stopped."""
    from eddyscan import pipeline

    with progress_bars() as progress:
        summary = pipeline.run(folder, rig_file=rig, arm=arm, dry_run=dry_run, progress=progress)
    _tell(summary, json)


def scan(
    folder: Path = Folder,
    rig: Path | None = RigFile,
    arm: bool = Arm,
    dry_run: bool = typer.Option(False, "--dry-run", help="Check everything and print what would move; nothing moves."),
    json: bool = Json,
) -> None:
    """Scan the folder's plan: move, settle, read, store; goes on where it stopped."""
    _single_step(folder, "record", json, rig_file=rig, arm=arm, dry_run=dry_run)


def analyse(folder: Path = Folder, json: bool = Json) -> None:
    """Turn the folder's record into a C-scan and indications."""
    _single_step(folder, "cscan", json)


def report(
    folder: Path = Folder,
    pdf: bool = typer.Option(False, "--pdf", help="Write report.pdf too: the same chapters on paper."),
    json: bool = Json,
) -> None:
    """Write the folder's report.html."""
    _single_step(folder, "report", json, pdf=pdf)


def status(folder: Path = Folder, json: bool = Json) -> None:
    """Show which steps are done, missing or stale."""
    from eddyscan import pipeline

    states = pipeline.states(folder)
    rows = [[s.name, s.state, s.why, "" if s.seconds is None else f"{s.seconds:.1f}"] for s in states]
    table(str(folder), ["step", "state", "why", "time s"], rows)
    if json:
        emit_json({"steps": [{"name": s.name, "state": s.state, "why": s.why, "seconds": s.seconds} for s in states]})


def _single_step(folder: Path, step: str, json: bool, **options: Any) -> None:
    from eddyscan import pipeline

    with progress_bars() as progress:
        result = pipeline.single_step(folder, step, progress=progress, **options)
    _tell(result, json)


def _tell(summary: dict[str, Any], json: bool) -> None:
    from eddyscan.pipeline.summary import summary_rows

    table("Inspection", ["quantity", "value"], summary_rows(summary))
    for warning in summary.get("warnings", []):
        say(f"warning: {warning}")
    if report_file := summary.get("report"):
        say(f"report: {report_file}")
    if json:
        emit_json(summary)
