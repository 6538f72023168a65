"""The command line. Heavy libraries are imported inside the commands, so `--help` answers at once."""

from __future__ import annotations

import os

# Many small products: threads inside the linear algebra only wait for each other. Set before numpy loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from eddyscan.cli.app import main

__all__ = ["main"]
