"""Commands that hold a device or a port: simulate, serve."""

from __future__ import annotations

import os
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
    port: int = typer.Option(8765, "--port", help="TCP port; 0 takes a free one.", min=0, max=65535),
    host: str = typer.Option(
        "127.0.0.1", "--host", help="Address to listen on; beyond this computer needs a password."
    ),
    ask_password: bool = typer.Option(
        False, "--ask-password", help="Ask for the password; else EDDYSCAN_PASSWORD holds it."
    ),
    rig: Path | None = typer.Option(None, "--rig", help="rig.toml of a real rig; the virtual cell without it."),
    arm: bool = typer.Option(False, "--arm", help="Allow the real rig to move; needed every time."),
    browser: bool = typer.Option(False, "--browser", help="Open the page in the default browser."),
) -> None:
    """Open the local web page."""
    from eddyscan.web import serve as serve_page

    password = typer.prompt("Password", hide_input=True) if ask_password else os.environ.get("EDDYSCAN_PASSWORD")
    serve_page(folder, port=port, host=host, rig_file=rig, arm=arm, password=password, open_browser=browser)
