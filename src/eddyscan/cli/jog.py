"""`eddyscan jog`: the stage by keyboard, and the touched points kept."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from eddyscan.cli.terminal import emit_json, messages, say
from eddyscan.core.errors import InputError

SEQUENCES = {
    "\x1b[A": "up",
    "\x1b[B": "down",
    "\x1b[C": "right",
    "\x1b[D": "left",
    "\x1b[5~": "pageup",
    "\x1b[6~": "pagedown",
    "\r": "enter",
    "\n": "enter",
    " ": "space",
    "\x03": "q",
    "": "q",
}
ESCAPE_S = 0.05


def register(app: typer.Typer) -> None:
    """Add this module's command."""
    app.command()(jog)


def jog(
    folder: Path = typer.Argument(..., help="The inspection folder.", metavar="DIR"),
    point: list[str] = typer.Option([], "--point", help="x,y,z [mm, part] of the points to touch, in order."),
    rig: Path | None = typer.Option(None, "--rig", help="rig.toml of a real rig; the virtual cell without it."),
    arm: bool = typer.Option(False, "--arm", help="Allow the real rig to move; needed every time."),
    json: bool = typer.Option(False, "--json", help="Print one JSON object on standard output."),
) -> None:
    """Move the stage with the keys and keep the touched corner, or points, as the part's place."""
    from eddyscan import pipeline

    part_mm = [_point(text) for text in point]
    with pipeline.jog_session(folder, rig_file=rig, arm=arm) as session, _keys() as keys:
        _show(session.state)
        for key in keys:
            state = session.press(key)
            _show(state)
            if state.done:
                break
        touched = session.state.points_mm
    messages.print()
    if not touched:
        say("no point taken; nothing kept.")
        return
    result = pipeline.keep_touched(folder, touched, part_mm)
    say(
        f"kept: {result['how']}, residual {result['residual_mm']:.3f} mm, uncertainty {result['uncertainty_mm']:.2f} mm"
    )
    if json:
        emit_json(result)


def _point(text: str) -> list[float]:
    try:
        values = [float(value) for value in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"--point {text}: write x,y,z in mm, for example --point 0,0,30.")
    return values


def _show(state: Any) -> None:
    position = "  ".join(f"{name} {value:8.3f}" for name, value in zip("xyzab", state.position, strict=False))
    text = f"{position} mm   step {state.step_mm:g} mm   points {len(state.points_mm)}   {state.message}"
    messages.print(f"\r\x1b[2K{text[: max(messages.width - 1, 20)]}", end="", markup=False, soft_wrap=True)


@contextlib.contextmanager
def _keys() -> Iterator[Iterator[str]]:
    """Yield the keys as they are pressed; from a pipe, the bytes of the pipe."""
    descriptor = sys.stdin.fileno()
    if not os.isatty(descriptor):
        yield _named(descriptor)
        return
    import termios
    import tty

    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield _named(descriptor)
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _named(descriptor: int) -> Iterator[str]:
    while True:
        text = os.read(descriptor, 1).decode("latin-1")
        while text.startswith("\x1b") and text not in SEQUENCES and select.select([descriptor], [], [], ESCAPE_S)[0]:
            more = os.read(descriptor, 1).decode("latin-1")
            if not more:
                break
            text += more
        yield SEQUENCES.get(text, text)
