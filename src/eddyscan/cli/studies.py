"""Commands over many inspections and on eddyscan itself: batch, validate."""

from __future__ import annotations

from pathlib import Path

import typer

from eddyscan.cli.terminal import emit_json, progress_bars, say, table
from eddyscan.core.errors import InputError

Json = typer.Option(False, "--json", help="Print one JSON object on standard output.")
Workers = typer.Option(1, "--workers", help="Local worker processes.", min=1, max=256)
Scheduler = typer.Option(None, "--scheduler", help="A Dask cluster instead: tcp://host:port.")


def register(app: typer.Typer) -> None:
    """Add this module's commands."""
    app.command()(campaign)
    app.command()(batch)
    app.command()(validate)


def campaign(
    file: Path = typer.Argument(..., help="What varies over a base technique.", metavar="CAMPAIGN.toml"),
    out: Path = typer.Option(..., "--out", help="Folder for the rows; an interrupted campaign goes on.", metavar="DIR"),
    workers: int = Workers,
    scheduler: str | None = Scheduler,
    json: bool = Json,
) -> None:
    """Run virtual inspections by the hundred or thousand: probability of detection, choice of probe and pitch."""
    from eddyscan.campaign.results import result_rows, summarise
    from eddyscan.campaign.run import run_campaign

    with progress_bars() as progress:
        rows = run_campaign(file, out, workers=workers, scheduler=scheduler, progress=progress, say=say)
    summary = summarise(rows, out)
    table(f"campaign {file} (simulation)", ["quantity", "value"], result_rows(summary))
    if json:
        emit_json(summary)


def batch(
    step: str = typer.Argument(..., help="surface, plan, analyse, report or run.", metavar="STEP"),
    folders: list[Path] = typer.Argument(..., help="Inspection folders.", metavar="DIR..."),
    workers: int = Workers,
    scheduler: str | None = Scheduler,
    json: bool = Json,
) -> None:
    """Do a step in many inspection folders; a failure leaves the others unharmed."""
    from eddyscan.campaign.batch import run_batch

    with progress_bars() as progress:
        rows = run_batch(step, folders, workers=workers, scheduler=scheduler, progress=progress)
    table(
        f"batch {step}", ["folder", "ok", "time s"], [[r["folder"], _yes(r["ok"]), f"{r['seconds']:.1f}"] for r in rows]
    )
    failed = [row for row in rows if not row["ok"]]
    for row in failed:
        say(f"failed: {row['folder']}: {row['error']}")
    if json:
        emit_json({"step": step, "done": len(rows) - len(failed), "failed": len(failed), "folders": rows})
    if failed:
        raise typer.Exit(1)


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def validate(name: str = typer.Argument("all", help="One experiment, or all.")) -> None:
    """Re-run the reference study's experiments and print their tables."""
    raise InputError(
        f"validate {name} is still to come; `python -m benchmarks.line` times the line beside the study's method."
    )
