"""Commands that hold a device or a port: simulate, serve."""

from __future__ import annotations

from pathlib import Path

import typer

from eddyscan.core.errors import InputError


def register(app: typer.Typer) -> None:
    """Add this module's commands."""
    app.command()(simulate)
    app.command()(serve)


def simulate(
    device: str = typer.Argument(..., help="zaber, lcr or grbl."),
    port: int = typer.Option(..., "--port", help="TCP port on the loopback; 0 takes a free one.", min=0, max=65535),
) -> None:
    """Run a stand-alone simulated device on the loopback until Ctrl-C."""
    from eddyscan import pipeline

    servers = pipeline.simulators()
    if device not in servers:
        raise InputError(f"there is no simulated device {device!r}; known are {', '.join(servers)}.")
    servers[device](port)


def serve(
    folder: Path = typer.Argument(Path("inspections"), help="An inspection folder or a folder of them.", metavar="DIR"),
) -> None:
    """Open the local web page."""
    raise InputError("the local page is still to come; use `eddyscan run DIR` and open 6-report/report.html.")
