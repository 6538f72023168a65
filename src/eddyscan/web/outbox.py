"""What the worker tells: kept in memory and sent twenty times a second by a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from eddyscan.core.record import Reading
from eddyscan.web.link import Link
from eddyscan.web.placing import Placing

EVERY_S = 0.05
SCAN = "scan"


class Outbox:
    """Collects events, progress and readings; putting something in never waits.

    Progress of one kind of work is replaced by newer progress, readings all go out.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._lock = threading.Lock()
        self._due = threading.Event()
        self._events: list[dict[str, Any]] = []
        self._progress: dict[str, tuple[float, float]] = {}
        self._sets: list[list[Reading]] = [[]]
        self._done: dict[str, float] = {}
        self._placing: Placing | None = None
        threading.Thread(target=self._send_for_ever, daemon=True, name="send").start()

    def begin(self, folder: Path, step: str) -> None:
        """Start a job's messages."""
        self._placing = Placing(folder)
        self._done = {}
        self.event("begun", step=step, folder=str(folder))

    def end(self, ending: dict[str, Any]) -> None:
        """Send everything, then the job's last message."""
        self.event(**ending)

    def event(self, event: str, **details: Any) -> None:
        """Tell that something happened; goes out at once."""
        with self._lock:
            self._events.append({"event": event, **details})
        self._due.set()

    def progress(self, what: str, done: float, total: float) -> None:
        """Take a Progress call."""
        with self._lock:
            if done < self._done.get(what, 0.0) and what == SCAN:
                self._sets.append([])  # the count began anew: another pass over the part
            self._done[what] = float(done)
            self._progress[what] = (float(done), float(total))

    def readings(self, readings: Sequence[Reading]) -> None:
        """Take readings that are on the disk."""
        with self._lock:
            self._sets[-1].extend(readings)

    def _send_for_ever(self) -> None:
        try:
            while True:
                self._due.wait(EVERY_S)
                self._due.clear()
                self._send_once()
        except OSError:
            return  # the door is gone; the listener ends the process

    def _send_once(self) -> None:
        with self._lock:
            events, self._events = self._events, []
            progress, self._progress = self._progress, {}
            sets, self._sets = self._sets, [[]]
        for what, (done, total) in progress.items():
            self._link.send({"event": "progress", "what": what, "done": done, "total": total})
        for number, readings in enumerate(sets):
            if number:
                self._link.send({"event": "pass"})
            if readings:
                self._send_readings(readings)
        for event in events:
            self._link.send(event)

    def _send_readings(self, readings: list[Reading]) -> None:
        if self._placing is None:
            return
        try:
            rows = self._placing.rows(readings)
        except Exception as error:  # showing must not end the sending, whatever is wrong with it
            self._placing = None
            self._link.send({"event": "note", "message": f"readings are recorded but cannot be shown live: {error}"})
            return
        self._link.send({"event": "readings", "rows": rows})
