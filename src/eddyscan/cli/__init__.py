"""The command line. Heavy libraries are imported inside the commands, so `--help` answers at once."""

from __future__ import annotations

from eddyscan.cli.app import main

__all__ = ["main"]
