"""Commands that measure eddyscan itself: validate."""

from __future__ import annotations

import typer

from eddyscan.core.errors import InputError


def register(app: typer.Typer) -> None:
    """Add this module's commands."""
    app.command()(validate)


def validate(
    name: str = typer.Argument("all", help="One experiment, or all."),
    json: bool = typer.Option(False, "--json", help="Print one JSON object on standard output."),
) -> None:
    """Re-run the reference study's experiments and print their tables."""
    raise InputError(
        f"validate {name} is still to come; `python -m benchmarks.line` times the line beside the study's method."
    )
