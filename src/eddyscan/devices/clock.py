"""The rig's clocks: wall, faster than wall, and virtual.

Nothing else in eddyscan asks the operating system for the time, so a scan can
run at life speed, twenty times faster, or as fast as the computer allows.
"""

from __future__ import annotations

import threading
import time

from eddyscan.core.errors import InputError


class WallClock:
    """Seconds as they pass."""

    def now(self) -> float:
        """Return monotonic seconds; only differences count."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait `seconds`; nothing when not positive."""
        if seconds > 0:
            time.sleep(seconds)


class ScaledClock:
    """A clock that runs `factor` times as fast as the wall's."""

    def __init__(self, factor: float) -> None:
        if not 0 < factor < float("inf"):
            raise InputError(f"a clock cannot run {factor} times as fast as the wall's; give a factor above 0.")
        self.factor = factor
        self._origin = time.monotonic()

    def now(self) -> float:
        """Return seconds of this clock since it was made."""
        return (time.monotonic() - self._origin) * self.factor

    def sleep(self, seconds: float) -> None:
        """Wait `seconds` of this clock; nothing when not positive."""
        if seconds > 0:
            time.sleep(seconds / self.factor)


class VirtualClock:
    """Time that moves only when somebody waits: repeatable and never idle.

    A simulated device charges the time its answer takes by sleeping, the
    software under test by waiting for motion; both advance the same time.
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self._now = start_s
        self._lock = threading.Lock()

    def now(self) -> float:
        """Return virtual seconds."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Move time on by `seconds` at once; nothing when not positive."""
        if seconds > 0:
            with self._lock:
                self._now += seconds

    advance = sleep
