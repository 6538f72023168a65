"""Serve the page until Ctrl-C and say at the terminal where it is."""

from __future__ import annotations

import asyncio
import signal
import sys
import webbrowser
from pathlib import Path

from eddyscan.core.errors import InputError
from eddyscan.web.access import VIEWER, checked_listening, is_loopback
from eddyscan.web.bench import RigChoice
from eddyscan.web.door import Running, open_door


def serve_for_ever(
    folder: Path,
    *,
    port: int,
    host: str,
    rig_file: Path | None,
    arm: bool,
    password: str | None,
    open_browser: bool,
) -> None:
    """Serve until SIGINT or SIGTERM, then stop the axes and end."""
    checked_listening(host, password)
    rig = checked_rig(rig_file, arm)

    async def until_told() -> None:
        told = asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            asyncio.get_running_loop().add_signal_handler(number, told.set)
        running = await open_door(folder, host=host, port=port, password=password, rig=rig)
        print(greeting(running, rig), file=sys.stderr, flush=True)
        if open_browser:
            webbrowser.open(running.address)
        try:
            await told.wait()
        finally:
            print("eddyscan: stopping the axes and closing the page.", file=sys.stderr, flush=True)
            await running.close()

    asyncio.run(until_told())


def checked_rig(rig_file: Path | None, arm: bool) -> RigChoice:
    """Return the rig the terminal allows; a real one needs both its file and the arm flag."""
    if rig_file is not None and not rig_file.is_file():
        raise InputError(f"there is no rig file {rig_file}. Check --rig.")
    if rig_file is not None and not arm:
        raise InputError(f"--rig {rig_file} names a real rig; it moves only with --arm given as well.")
    if arm and rig_file is None:
        raise InputError("--arm without --rig arms nothing: name the rig with --rig lab.toml, or leave --arm out.")
    return RigChoice(None if rig_file is None else rig_file.absolute(), arm)


def greeting(running: Running, rig: RigChoice) -> str:
    """Return what the terminal shows: the addresses and what may move."""
    access = running.door.access
    lines = [
        f"eddyscan page: {running.address}",
        f"read-only:     {access.address(VIEWER)}",
        f"inspections:   {running.door.root}",
        f"rig:           {rig.file}, ARMED"
        if rig.file
        else "rig:           virtual cell; a real rig needs --rig and --arm",
    ]
    if not (is_loopback(access.host) or access.host == "localhost"):
        lines.append("open to the network with a password; unencrypted, so only in a network you trust")
    return "\n".join([*lines, "Ctrl-C stops the axes and ends the page."])
