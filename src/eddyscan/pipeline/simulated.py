"""The stand-alone simulated devices, by name."""

from __future__ import annotations

from collections.abc import Callable


def simulators() -> dict[str, Callable[[int], None]]:
    """Return name -> function that serves on a port until Ctrl-C."""
    return {"zaber": _zaber, "lcr": _lcr, "grbl": _grbl}


def _zaber(port: int) -> None:
    from eddyscan.devices.sim.zaber import serve_zaber

    serve_zaber(port)


def _lcr(port: int) -> None:
    from eddyscan.devices.sim.lcr import serve_lcr

    serve_lcr(port)


def _grbl(port: int) -> None:
    from eddyscan.devices.sim.grbl import serve_grbl

    serve_grbl(port)
