"""The bench: one job at a time, whatever the number of pages; what it does and what it read."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eddyscan.core.errors import InputError, WorkError
from eddyscan.web.child import Child
from eddyscan.web.job import STEPS, TITLES, Job

LOG_KEPT = 300
LINE = "eddyscan.pipeline"


@dataclass(frozen=True)
class RigChoice:
    """The rig the terminal allows: none is the virtual cell of each inspection."""

    file: Path | None = None
    arm: bool = False


class Bench:
    """Owns the worker process; every page speaks to the rig through this one object."""

    def __init__(self, rig: RigChoice | None = None, *, line: str = LINE, on_change: Callable[[], None]) -> None:
        self.rig = rig or RigChoice()
        self._on_change = on_change
        self._child = Child("eddyscan.web.worker", [line], on_message=self._take, on_exit=self._worker_died)
        self.job: Job | None = None
        self._next: list[str] = []
        self.readings: list[list[float | None]] = []
        self.scan_number = 0
        self.scan_begins_anew = False
        self.log: deque[dict[str, Any]] = deque(maxlen=LOG_KEPT)
        self._logged = 0
        self.revision = 0
        self.stop_seconds: float | None = None
        self._stop_asked: float | None = None

    @property
    def worker_pid(self) -> int | None:
        """Return the worker's process id while it runs."""
        return self._child.pid

    async def start(self) -> None:
        """Start the worker so that the first step needs not wait for it."""
        await self._child.start()

    async def close(self) -> None:
        """Stop the axes and end the worker."""
        self._child.send({"do": "stop"})
        await self._child.close()

    def busy_with(self, folder: Path) -> bool:
        """Tell whether the worker is at this folder."""
        return self.job is not None and self.job.active and self.job.folder == str(folder)

    async def run(self, folder: Path, steps: Sequence[str], *, who: str = "operator") -> int:
        """Start one step, or several one after the other, and return the job's number.

        Raises InputError for an unknown step, WorkError while the bench is busy.
        """
        unknown = [step for step in steps if step not in STEPS]
        if unknown or not steps:
            raise InputError(f"there is no step {unknown or 'given'}; known are {', '.join(STEPS)}.")
        if self.job is not None and self.job.active:
            raise WorkError(
                f"the bench is busy: {TITLES[self.job.step]} of {Path(self.job.folder).name} is under way. "
                "Wait for it, or press Stop."
            )
        self.job = self._new_job(folder, steps[0])
        self._next = list(steps[1:])
        try:
            await self._child.start()
        except OSError as error:
            self._finish("failed", f"the work process did not start: {error}. Restart eddyscan serve.")
            raise WorkError(self.job.message) from error
        self._send_step(self.job)
        self.tell(f"{TITLES[self.job.step]} started by the {who}.")
        return self.job.number

    def pause(self) -> None:
        """Hold the scan after the reading under way."""
        self._require_scan("Pause")
        self._child.send({"do": "pause"})

    def resume(self) -> None:
        """Let a held scan go on."""
        self._require_scan("Go on")
        self._child.send({"do": "resume"})

    def stop(self, who: str = "operator") -> None:
        """Stop the axes now and end the job; harmless when nothing runs."""
        sent = self._child.send({"do": "stop"})
        if self.job is None or not self.job.active:
            return
        self._next = []
        if self.job.state != "stopping":
            self.job.state = "stopping"
            self._stop_asked = time.monotonic()
            words = f"Stop pressed by the {who}."
            self.tell(words if sent else f"{words} THE WORK PROCESS IS GONE: use the emergency stop.", "warning")

    def tell(self, message: str, level: str = "info") -> None:
        """Add a line to the log that every page shows."""
        self._logged += 1
        self.log.append({"number": self._logged, "time": time.time(), "level": level, "message": message})
        self._on_change()

    @property
    def stop_unanswered_s(self) -> float | None:
        """Return for how long a Stop has had no answer."""
        return None if self._stop_asked is None else time.monotonic() - self._stop_asked

    def _require_scan(self, button: str) -> None:
        if self.job is None or not self.job.active or self.job.step != "record":
            raise InputError(f"{button} acts on a scan, and no scan is under way.")

    def _new_job(self, folder: Path, step: str) -> Job:
        if step == "record":
            self._new_readings(anew=False)
        self.stop_seconds, self._stop_asked = None, None
        return Job(1 if self.job is None else self.job.number + 1, str(folder), step)

    def _send_step(self, job: Job) -> None:
        rig = {"rig": str(self.rig.file), "arm": self.rig.arm} if self.rig.file is not None else {}
        if not self._child.send({"do": "step", "folder": job.folder, "step": job.step, **rig}):
            self._finish("failed", "the work process does not listen. Press the button again; it is started anew.")

    def _take(self, message: dict[str, Any], _payload: bytes) -> None:
        if self.job is not None:
            getattr(self, f"_on_{message['event'].replace('-', '_')}")(message, self.job)
        self._on_change()

    def _on_begun(self, message: dict[str, Any], job: Job) -> None:
        job.began = time.monotonic()

    def _on_progress(self, message: dict[str, Any], job: Job) -> None:
        if message["what"] != job.what:
            self.tell(f"{TITLES[job.step]}: {message['what']}.")
        job.progressed(message["what"], message["done"], message["total"])

    def _on_readings(self, message: dict[str, Any], job: Job) -> None:
        self.readings.extend(message["rows"])

    def _on_pass(self, message: dict[str, Any], job: Job) -> None:
        self._new_readings(anew=True)
        self.tell("Scan: the next pass over the part begins.")

    def _new_readings(self, *, anew: bool) -> None:
        self.readings = []
        self.scan_number += 1
        self.scan_begins_anew = anew

    def _on_note(self, message: dict[str, Any], job: Job) -> None:
        self.tell(message["message"], "warning")

    def _on_paused(self, message: dict[str, Any], job: Job) -> None:
        if job.state == "running":
            job.state = "paused"
            self.tell("Scan paused: the probe waits after the reading under way.")

    def _on_going(self, message: dict[str, Any], job: Job) -> None:
        if job.state == "paused":
            job.state = "running"
            self.tell("Scan goes on.")

    def _on_axes_stopped(self, message: dict[str, Any], job: Job) -> None:
        if self._stop_asked is not None and self.stop_seconds is None:
            self.stop_seconds = time.monotonic() - self._stop_asked
            self._stop_asked = None
            if message.get("fault"):
                self.tell(f"The stage answered Stop with {message['fault']}. USE THE EMERGENCY STOP.", "error")

    def _on_done(self, message: dict[str, Any], job: Job) -> None:
        for warning in message.get("warnings", []):
            self.tell(warning, "warning")
        self._finish("done", "")
        self.tell(f"{TITLES[job.step]} done in {time.monotonic() - job.began:.1f} s.")
        if self._next:
            self.job = self._new_job(Path(job.folder), self._next.pop(0))
            self._send_step(self.job)
            self.tell(f"{TITLES[self.job.step]} started.")

    def _on_stopped(self, message: dict[str, Any], job: Job) -> None:
        self._finish("stopped", message["message"])
        took = (
            ""
            if self.stop_seconds is None
            else f" The stage confirmed {1000 * self.stop_seconds:.0f} ms after the click."
        )
        self.tell(message["message"] + took, "warning")

    def _on_failed(self, message: dict[str, Any], job: Job) -> None:
        self._finish("failed", message["message"])
        self.tell(message["message"], "error")

    def _worker_died(self, code: int) -> None:
        if self.job is not None and self.job.active:
            message = (
                f"the work process ended unexpectedly (code {code}) during {TITLES[self.job.step]}. "
                "Look at the rig; everything recorded is kept. Run the step again: it goes on."
            )
            self._finish("failed", message)
            self.tell(message, "error")

    def _finish(self, state: str, message: str) -> None:
        if self.job is not None:
            self.job.state, self.job.message = state, message
            self._next = self._next if state == "done" else []
        self._stop_asked = None
        self.revision += 1
        self._on_change()
