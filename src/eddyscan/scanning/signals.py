"""Signals that end a scan the way a fault does: axes stopped, probe lifted, record whole."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from eddyscan.core.errors import ScanAborted

ENDS_A_SCAN = {
    signal.SIGTERM: "the system asked the program to end (SIGTERM)",
    signal.SIGHUP: "the terminal was closed (SIGHUP)",
}


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into ScanAborted inside the block; Ctrl-C stays KeyboardInterrupt.

    Only the main thread can hear signals; in any other the block runs as it is.
    A signal that the parent chose to ignore (nohup) stays ignored.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in ENDS_A_SCAN}
    for number, handler in before.items():
        if handler != signal.SIG_IGN:
            signal.signal(number, _abort)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _abort(number: int, _frame: FrameType | None) -> None:
    why = ENDS_A_SCAN[signal.Signals(number)]
    raise ScanAborted(f"{why} during the scan; everything read so far is kept. Run again to go on.")
