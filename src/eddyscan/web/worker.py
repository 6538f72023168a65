"""The one process that owns the rig: runs pipeline steps, one at a time, and stops at once.

Run as ``python -m eddyscan.web.worker FD LINE``; LINE names the module that does
the steps (the pipeline). The main thread works, a second one listens, a third
one sends, so a slow page can hold up neither the scan nor a Stop.
When the door dies the wire ends: the axes stop and the process ends.
"""

from __future__ import annotations

import _thread
import importlib
import os
import queue
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import Any

from eddyscan.core.errors import EddyscanError, ScanAborted
from eddyscan.pipeline.control import ScanControl
from eddyscan.web.link import Link
from eddyscan.web.outbox import Outbox
from eddyscan.web.priority import first_in_line, like_everybody

SWITCH_INTERVAL_S = 0.001
GIVE_UP_S = 5.0


class Worker:
    """Takes jobs from the wire and tells how they go."""

    def __init__(self, link: Link, line: Any) -> None:
        self._link = link
        self._line = line
        self._outbox = Outbox(link)
        self._jobs: queue.Queue[dict[str, Any] | None] = queue.Queue()
        self._control: ScanControl | None = None
        self._busy: str | None = None

    def serve(self) -> None:
        """Work until the door closes the wire."""
        threading.Thread(target=self._listen, daemon=True, name="listen").start()
        while True:
            try:
                job = self._jobs.get()
                if job is None:
                    return
                self._do(job)
            except KeyboardInterrupt:  # a Stop that came just after its job had ended
                continue

    def _listen(self) -> None:
        first_in_line()
        for message in self._link.messages():
            getattr(self, f"_on_{message['do']}")(message)
        self._stop_work()
        self._jobs.put(None)
        time.sleep(GIVE_UP_S)
        os._exit(3)

    def _on_step(self, message: dict[str, Any]) -> None:
        self._control = ScanControl(self._outbox.readings)
        self._jobs.put(message)

    def _on_pause(self, message: dict[str, Any]) -> None:
        if self._control is not None:
            self._control.pause()
            self._outbox.event("paused")

    def _on_resume(self, message: dict[str, Any]) -> None:
        if self._control is not None:
            self._control.resume()
            self._outbox.event("going")

    def _on_stop(self, message: dict[str, Any]) -> None:
        started = time.perf_counter()
        fault = self._stop_work()
        self._outbox.event("axes-stopped", seconds=time.perf_counter() - started, id=message.get("id"), fault=fault)

    def _stop_work(self) -> str:
        fault = ""
        if self._control is not None:
            try:
                self._control.stop()
            except Exception as error:  # whatever the driver says, the job must still end
                fault = f"{type(error).__name__}: {error}"
        if self._busy is not None and self._busy != "record":
            _thread.interrupt_main()
        return fault

    def _do(self, job: dict[str, Any]) -> None:
        step, folder = job["step"], Path(job["folder"])
        self._busy = step
        self._outbox.begin(folder, step)
        try:
            result = self._run(step, folder, job)
            ending: dict[str, Any] = {"event": "done", "warnings": result.get("warnings", [])}
        except ScanAborted as error:
            ending = {"event": "stopped", "message": str(error)}
        except KeyboardInterrupt:
            ending = {"event": "stopped", "message": f"{step} was stopped; the folder is as it was before."}
        except Exception as error:
            ending = self._ending_of(step, error)
        finally:
            self._busy = None
        self._outbox.end(ending)

    def _ending_of(self, step: str, error: Exception) -> dict[str, Any]:
        kind = type(error).__name__
        if self._control is not None and self._control.stopped:
            # A move cut short by Stop ends in the driver's own words; it is a stop all the same.
            return {
                "event": "stopped",
                "message": "the scan was stopped; everything read so far is kept.",
                "kind": kind,
            }
        if isinstance(error, EddyscanError):
            return {"event": "failed", "message": str(error), "kind": kind}
        traceback.print_exception(error)
        return {"event": "failed", "kind": kind, "message": unforeseen(step, error)}

    def _run(self, step: str, folder: Path, job: dict[str, Any]) -> dict[str, Any]:
        options: dict[str, Any] = {"progress": self._outbox.progress, "control": self._control}
        if job.get("rig"):
            options |= {"rig_file": Path(job["rig"]), "arm": bool(job.get("arm"))}
        if step == "check":
            return dict(self._line.single_step(folder, "record", dry_run=True, **options))
        return dict(self._line.single_step(folder, step, **options))


def unforeseen(what: str, error: BaseException) -> str:
    """Return words for a fault nobody foresaw; the terminal has the rest."""
    return (
        f"{what} failed in a way nobody foresaw: {type(error).__name__}: {error}. Nothing recorded is lost. "
        "The terminal that runs the page shows where; run the step again."
    )


def main() -> None:
    """Run as a helper process."""
    like_everybody()
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    link = Link.of_descriptor(int(sys.argv[1]))
    Worker(link, importlib.import_module(sys.argv[2])).serve()


if __name__ == "__main__":
    main()
