"""The device that `my_stage.py` talks to, simulated: enough of it to run the contract suite on."""

from __future__ import annotations

import contextlib
import socketserver
import threading

import numpy as np

from eddyscan.devices.protocols import Clock

AXES = "x 0 150 25 y 0 150 25 z 0 50 25"
UPPER = np.array([150.0, 150.0, 50.0])


class MyDevice:
    """Moves at constant speed on a straight line; answers one line to each line, none to STOP."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._lock, self._homed = clock, threading.Lock(), False
        self._start = self._end = np.array([10.0, 10.0, 20.0])
        self._began = self._takes = 0.0
        device = self

        class Handler(socketserver.StreamRequestHandler):
            def handle(self) -> None:
                with contextlib.suppress(OSError):
                    for line in self.rfile:
                        answer = device.answer(line.decode().split())
                        if answer is not None:
                            self.wfile.write(answer.encode() + b"\n")

        class Server(socketserver.ThreadingTCPServer):
            daemon_threads, block_on_close = True, False

        self._server = Server(("127.0.0.1", 0), Handler)
        host, port = self._server.server_address[:2]
        self.address = f"{host}:{port}"
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def answer(self, words: list[str]) -> str | None:
        with self._lock:
            share = 1.0 if self._takes == 0 else min((self._clock.now() - self._began) / self._takes, 1.0)
            here = self._start + share * (self._end - self._start)
            if words[0] == "STOP":
                self._go(here, here, 1.0)
                return None
            if words[0] == "HOME":
                self._homed = True
                self._go(here, np.array([0.0, 0.0, UPPER[2]]), 25.0)
            elif words[0] == "MOVE":
                *goal, speed = (float(word) for word in words[1:])
                if not self._homed:
                    return "ERROR no reference"
                self._go(here, np.round(goal, 3), speed)
            told = " ".join(f"{value:.3f}" for value in here) if self._homed else "UNKNOWN"
            return {"AXES": AXES, "POS": told, "BUSY": str(int(share < 1.0))}.get(words[0], "OK")

    def _go(self, start: np.ndarray, end: np.ndarray, speed: float) -> None:
        self._start, self._end, self._began = start, end, self._clock.now()
        self._takes = float(np.linalg.norm(end - start)) / speed
