"""Pause, stop and watch a running scan from another thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Protocol

from eddyscan.core.errors import ScanAborted
from eddyscan.core.record import Reading
from eddyscan.devices.protocols import RecordSink


class Stoppable(Protocol):
    """A stage, as far as stopping it goes."""

    def stop(self) -> None:
        """Stop every axis now."""


class ScanControl:
    """Held by a page or a terminal while the pipeline scans.

    `stop` acts at once, from any thread and more than once: the axes stop, the
    scan ends with ScanAborted, the record stays whole. `pause` takes hold after
    the reading under way.
    """

    def __init__(self, on_readings: Callable[[Sequence[Reading]], None] | None = None) -> None:
        self._on_readings = on_readings
        self._going = threading.Event()
        self._going.set()
        self._stopped = threading.Event()
        self._stage: Stoppable | None = None

    @property
    def paused(self) -> bool:
        """Tell whether the scan is held."""
        return not self._going.is_set()

    @property
    def stopped(self) -> bool:
        """Tell whether a stop was asked for."""
        return self._stopped.is_set()

    def pause(self) -> None:
        """Hold the scan after the reading under way."""
        self._going.clear()

    def resume(self) -> None:
        """Let a held scan go on."""
        self._going.set()

    def stop(self) -> None:
        """Stop the axes now and end the scan."""
        self._stopped.set()
        if self._stage is not None:
            self._stage.stop()
        self._going.set()

    def attach(self, stage: Stoppable) -> None:
        """Tell which stage `stop` acts on; raises ScanAborted when stop came before."""
        self._stage = stage
        self.check()

    def check(self) -> None:
        """Wait while paused; raise ScanAborted once stopped."""
        self._going.wait()
        if self._stopped.is_set():
            raise ScanAborted("the scan was stopped by the operator; everything read so far is kept.")

    def saw(self, readings: Sequence[Reading]) -> None:
        """Pass durable readings on to the watcher."""
        if self._on_readings is not None:
            self._on_readings(readings)


class WatchedSink:
    """A record sink that tells a ScanControl of every reading, after it is durable."""

    def __init__(self, sink: RecordSink, control: ScanControl) -> None:
        self._sink = sink
        self._control = control

    def write(self, readings: Sequence[Reading]) -> None:
        """Store, tell, then wait while paused or end when stopped."""
        self._sink.write(readings)
        self._control.saw(readings)
        self._control.check()

    def done(self) -> set[tuple[int, int]]:
        """Return the (row, point) pairs that already have a reading."""
        return self._sink.done()

    def note(self, key: str, value: object) -> None:
        """Store a settings or event entry."""
        self._sink.note(key, value)

    def close(self) -> None:
        """Close the sink behind."""
        self._sink.close()
