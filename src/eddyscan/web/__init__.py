"""The local page: see the part, the plan and the signal live, and stop it with one click."""

from __future__ import annotations

from pathlib import Path


def serve(
    folder: Path,
    *,
    port: int = 8765,
    host: str = "127.0.0.1",
    rig_file: Path | None = None,
    arm: bool = False,
    password: str | None = None,
    open_browser: bool = False,
) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    folder : an inspection folder, or a folder of them (made when missing)
    port : TCP port; 0 takes a free one
    host : address to listen on; anything but the loopback needs a password
    rig_file, arm : a real rig moves only with both, given at this terminal
    password : for pages that are not on this computer
    open_browser : show the page in the default browser

    Raises
    ------
    InputError
        When the port is taken, the folder cannot be had, the password is missing
        or short, or a rig is named and not armed.
    """
    from eddyscan.web.serving import serve_for_ever

    serve_for_ever(
        folder, port=port, host=host, rig_file=rig_file, arm=arm, password=password, open_browser=open_browser
    )


__all__ = ["serve"]
