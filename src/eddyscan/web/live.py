"""The live wire of one page: news at most ten times a second, Stop in at any time.

Each page has a cursor of its own and its next message is made when the last one
is out, so a slow page falls behind alone and nothing piles up for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from typing import Any

import tornado.websocket

from eddyscan.core.errors import EddyscanError
from eddyscan.web.access import OPERATOR
from eddyscan.web.door import MAX_PAGES, Door
from eddyscan.web.guarded import foreign
from eddyscan.web.link import framed

PERIOD_S = 0.1
IDLE_PERIOD_S = 1.0
READINGS_AT_ONCE = 2000
PROTOCOL = "eddyscan"


class Live(tornado.websocket.WebSocketHandler):
    """One page's socket."""

    role: str | None = None

    def initialize(self, door: Door) -> None:
        self.door = door
        self._awake = asyncio.Event()
        self._sending: asyncio.Task[None] | None = None
        self._scan = 0
        self._readings = 0
        self._logged = 0

    def prepare(self) -> None:
        fault = foreign(self.door, self.request)
        offered = [word.strip() for word in self.request.headers.get("Sec-WebSocket-Protocol", "").split(",")]
        token = offered[1] if len(offered) == 2 and offered[0] == PROTOCOL else None
        self.role = self.door.access.role_of(token, self.request.remote_ip or "")
        if fault or self.role is None:
            self.set_status(403 if fault else 401)
            self.finish({"error": fault or "the token is missing or wrong."})
        elif len(self.door.pages) >= MAX_PAGES:
            self.set_status(503)
            self.finish({"error": f"{MAX_PAGES} pages are open already. Close one."})

    def check_origin(self, origin: str) -> bool:
        return self.door.access.origin_allowed(origin, self.request.headers.get("Host"))

    def select_subprotocol(self, subprotocols: list[str]) -> str | None:
        return PROTOCOL if PROTOCOL in subprotocols else None

    def open(self, *args: str, **kwargs: str) -> None:
        self.set_nodelay(True)
        self.door.pages.add(self)
        self._awake.set()
        self._sending = asyncio.ensure_future(self._send_for_ever())

    def on_close(self) -> None:
        self.door.pages.discard(self)
        if self._sending is not None:
            self._sending.cancel()

    def wake(self) -> None:
        """Tell that there is news."""
        self._awake.set()

    def on_message(self, message: str | bytes) -> None:
        try:
            command = json.loads(message)
            do, number = command.get("do"), command.get("id")
        except (ValueError, AttributeError):
            return
        answer: dict[str, Any] = {"answer": number}
        try:
            self._obey(do)
        except EddyscanError as error:
            answer["error"] = str(error)
        with contextlib.suppress(tornado.websocket.WebSocketClosedError):
            self.write_message(json.dumps(answer))

    def _obey(self, do: Any) -> None:
        bench = self.door.bench
        if do == "stop":
            bench.stop(self.role or "viewer")
        elif do == "pause" and self.role == OPERATOR:
            bench.pause()
        elif do == "resume" and self.role == OPERATOR:
            bench.resume()

    async def _send_for_ever(self) -> None:
        with contextlib.suppress(tornado.websocket.WebSocketClosedError, asyncio.CancelledError):
            while True:
                began = time.monotonic()
                self._awake.clear()
                await self.write_message(framed(self._news()).decode())
                await asyncio.sleep(PERIOD_S - (time.monotonic() - began))
                if self._is_behind():
                    continue
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._awake.wait(), IDLE_PERIOD_S)

    def _is_behind(self) -> bool:
        return self._readings < len(self.door.bench.readings)

    def _news(self) -> dict[str, Any]:
        bench = self.door.bench
        job = bench.job
        if bench.scan_number != self._scan:
            self._scan, self._readings = bench.scan_number, 0
        readings = bench.readings[self._readings : self._readings + READINGS_AT_ONCE]
        first = self._readings
        self._readings += len(readings)
        new = [entry for entry in bench.log if entry["number"] > self._logged]
        self._logged = new[-1]["number"] if new else self._logged
        return {
            "time": time.time(),
            "job": None if job is None else job.told(),
            "stop_ms": None if bench.stop_seconds is None else 1000 * bench.stop_seconds,
            "stop_unanswered_s": bench.stop_unanswered_s,
            "revision": bench.revision,
            "pages": len(self.door.pages),
            "log": new,
            "scan": self._scan,
            "anew": bench.scan_begins_anew,
            "first": first,
            "total": len(bench.readings),
            "readings": readings,
        }
