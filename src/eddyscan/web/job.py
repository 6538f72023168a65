"""One piece of work of the bench: which step, how far, how it ended."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from typing import Any

STEPS = ("views", "surface", "plan", "check", "record", "cscan", "report")
TITLES = {
    "views": "Views",
    "surface": "Surface",
    "plan": "Plan",
    "check": "Align",
    "record": "Scan",
    "cscan": "Results",
    "report": "Report",
}


@dataclass
class Job:
    """The work under way, or the last one."""

    number: int
    folder: str
    step: str
    state: str = "running"  # running, paused, stopping, done, stopped, failed
    what: str = ""
    done: float = 0.0
    total: float = 0.0
    seconds_left: float | None = None
    message: str = ""
    began: float = field(default_factory=time.monotonic)
    what_began: float = field(default_factory=time.monotonic)
    what_done: float = 0.0

    @property
    def active(self) -> bool:
        """Tell whether the worker is still at it."""
        return self.state in ("running", "paused", "stopping")

    def told(self) -> dict[str, Any]:
        """Return what a page shows of it."""
        shown = asdict(self)
        for inner in ("began", "what_began", "what_done"):
            del shown[inner]
        return shown | {"title": TITLES[self.step], "active": self.active, "seconds": time.monotonic() - self.began}

    def progressed(self, what: str, done: float, total: float) -> None:
        """Take progress and guess the time left from the pace so far."""
        now = time.monotonic()
        if what != self.what:
            self.what, self.what_began, self.what_done = what, now, done
        gained = done - self.what_done
        self.done, self.total = done, total
        self.seconds_left = (now - self.what_began) * (total - done) / gained if gained > 0 else None
