"""The threads that carry a Stop go first, where the system allows it (Linux: per thread; root or RLIMIT_NICE)."""

from __future__ import annotations

import contextlib
import os
import threading

FIRST = -10


def first_in_line() -> None:
    """Let the calling thread run before others; without the right to, nothing changes."""
    _set(FIRST)


def like_everybody() -> None:
    """Give back what a helper process inherited from the thread that started it."""
    _set(0)


def _set(niceness: int) -> None:
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), niceness)
