"""A simulated GRBL 1.1 controller on a loopback TCP port.

Straight moves queue up and run one after the other, each from rest to rest: the
real planner's rounding of corners is left out. After homing every axis stands at
machine 0, the upper end of its travel, as GRBL has it; travel is $130 onwards.
"""

from __future__ import annotations

import contextlib
import re
import socket
import threading
from dataclasses import dataclass, replace

import numpy as np

from eddyscan.core.errors import DeviceError
from eddyscan.core.frames import Array
from eddyscan.devices.clock import ScaledClock
from eddyscan.devices.protocols import Clock
from eddyscan.devices.sim.grbl_settings import GrblSettings
from eddyscan.devices.sim.zaber_axis import error_waves
from eddyscan.devices.trapezoid import Motion, brake, move

QUEUE = 15
REAL_TIME = b"?!~\x18"
LOCKED, UNKNOWN_WORD, BEYOND = b"error:9", b"error:20", b"error:15"
WORD = re.compile(r"([A-Z])(-?\d+\.?\d*)")


@dataclass(frozen=True)
class _Line:
    """A straight way from one machine position to another and the motion along it."""

    begin: Array
    direction: Array
    motion: Motion
    began_s: float

    def at(self, now: float) -> Array:
        return np.asarray(self.begin + self.direction * self.motion.state(now - self.began_s)[0])


class GrblSimulator:
    """Speaks GRBL 1.1; motion runs in `clock`'s time."""

    def __init__(self, settings: GrblSettings, clock: Clock) -> None:
        self.settings, self.clock = settings, clock
        rng = np.random.default_rng(settings.seed)
        self._waves = [error_waves(axis.accuracy, rng) for axis in settings.axes]
        self._travel = np.array([axis.travel for axis in settings.axes])
        lower = np.array([axis.lower for axis in settings.axes])
        self._machine = np.array([axis.start for axis in settings.axes]) - lower - self._travel
        self._queue: list[tuple[Array, float]] = []
        self._line: _Line | None = None
        self.state = "Alarm"
        self._feed = 60.0
        self._lock = threading.RLock()
        self._server: socket.socket | None = None
        self._sockets: list[socket.socket] = []
        self.silent = False
        self.jammed = False

    def true_position(self) -> Array:
        """Return the hidden true axis readings (n_axes,) [mm or deg, stage]."""
        with self._lock:
            self._update()
            native = self._machine + self._travel
            phase = 2 * np.pi * native / self._travel
            off = [
                sum(size * (np.sin(k * p + shift) - np.sin(shift)) for k, size, shift in waves)
                for p, waves in zip(phase, self._waves, strict=True)
            ]
            lower = np.array([axis.lower for axis in self.settings.axes])
            return np.asarray(lower + native + np.array(off), dtype=np.float64)

    def moving(self) -> bool:
        """Return whether the machine moves at this moment."""
        with self._lock:
            self._update()
            return self._line is not None

    def start(self, port: int = 0) -> tuple[str, int]:
        """Listen on `port` (0: any free one); return (host, port)."""
        try:
            self._server = socket.create_server((self.settings.host, port))
        except OSError as fault:
            raise DeviceError(
                f"the simulated GRBL cannot listen on {self.settings.host}:{port}: {fault}. Give another port."
            ) from fault
        threading.Thread(target=self._accept, args=(self._server,), name="grbl-simulator", daemon=True).start()
        host, bound = self._server.getsockname()[:2]
        return str(host), int(bound)

    def close(self) -> None:
        """Stop listening and drop every connection."""
        if self._server is not None:
            with contextlib.suppress(OSError):
                self._server.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
            self._server.close()
        self.drop_link()

    def drop_link(self) -> None:
        """Cut every connection; the machine keeps moving."""
        for sock in self._sockets:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)

    # -- the wire ------------------------------------------------------------

    def _accept(self, server: socket.socket) -> None:
        while True:
            try:
                sock, _ = server.accept()
            except OSError:
                return
            self._sockets.append(sock)
            threading.Thread(target=self._serve, args=(sock,), name="grbl-link", daemon=True).start()

    def _serve(self, sock: socket.socket) -> None:
        held = b""
        with contextlib.suppress(OSError), sock:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            sock.sendall(self._greeting())
            while data := sock.recv(1024):
                for byte in (bytes([b]) for b in data):
                    if byte in REAL_TIME:
                        self._say(sock, self.real_time(byte))
                    elif byte in b"\r\n":
                        if held.strip():
                            self._say(sock, self.answer(held.decode("latin-1").strip()))
                        held = b""
                    else:
                        held += byte
        if sock in self._sockets:
            self._sockets.remove(sock)

    def _say(self, sock: socket.socket, lines: list[bytes]) -> None:
        self.clock.sleep(self.settings.reply_delay_s)
        if lines and not self.silent:
            sock.sendall(b"".join(line + b"\r\n" for line in lines))

    def _greeting(self) -> bytes:
        return f"\r\nGrbl {self.settings.version} ['$' for help]\r\n".encode()

    def real_time(self, byte: bytes) -> list[bytes]:
        """Act on a real-time byte and return what is said."""
        with self._lock:
            self._update()
            if byte == b"?":
                place = ",".join(f"{v:.3f}" for v in self._machine)
                return [f"<{self._told_state()}|MPos:{place}|FS:0,0>".encode()]
            if byte == b"!":
                self._hold()
            elif byte == b"~" and self.state == "Hold":
                self.state = "Idle"
            elif byte == b"\x18":
                moving, self._line = self._line is not None, None
                self._queue.clear()
                self.state = "Alarm" if moving or self.state == "Alarm" else "Idle"
                return [*([b"ALARM:3"] if moving else []), self._greeting().strip()]
            return []

    def answer(self, line: str) -> list[bytes]:
        """Act on one line and return what is said."""
        with self._lock:
            self._update()
            if line == "$$":
                return [*self._dollar_settings(), b"ok"]
            if line == "$I":
                return [f"[VER:{self.settings.version}.20190825:]".encode(), b"[OPT:V,15,128]", b"ok"]
            if line == "$H":
                return self._home()
            if line == "$X":
                self.state = "Idle"
                return [b"[MSG:Caution: Unlocked]", b"ok"]
            if line.startswith("$"):
                return [b"error:3"]
            return [self._g_code(line.upper().replace(" ", ""))]

    def _told_state(self) -> str:
        if self.state == "Hold":
            return "Hold:1" if self._line is not None else "Hold:0"
        return "Run" if self._line is not None else self.state

    def _dollar_settings(self) -> list[bytes]:
        lines = ["$20=1", "$22=1"]
        for base, values in (
            (100, [1 / axis.microstep for axis in self.settings.axes]),
            (110, [60 * axis.max_speed for axis in self.settings.axes]),
            (120, [axis.acceleration for axis in self.settings.axes]),
            (130, list(self._travel)),
        ):
            lines += [f"${base + k}={value:.3f}" for k, value in enumerate(values)]
        return [line.encode() for line in lines]

    # -- motion --------------------------------------------------------------

    def _home(self) -> list[bytes]:
        slowest = max(-m / axis.max_speed for m, axis in zip(self._machine, self.settings.axes, strict=True))
        self.clock.sleep(slowest + 0.5)
        self._machine, self.state = np.zeros(len(self._travel)), "Idle"
        return [b"ok"]

    def _g_code(self, line: str) -> bytes:
        if self.state == "Alarm":
            return LOCKED
        words = WORD.findall(line)
        if "".join(letter + number for letter, number in words) != line:
            return UNKNOWN_WORD
        target = (self._queue[-1][0] if self._queue else self._goal()).copy()
        names = {axis.name.upper(): k for k, axis in enumerate(self.settings.axes)}
        motion = False
        for letter, number in words:
            if letter == "F":
                self._feed = float(number)
            elif letter in names:
                target[names[letter]], motion = float(number), True
            elif letter != "G" or number not in ("0", "1", "21", "53", "90", "94"):
                return UNKNOWN_WORD
        if (target < -self._travel - 1e-6).any() or (target > 1e-6).any():
            self.state = "Alarm"
            return BEYOND
        if motion and len(self._queue) < QUEUE:
            steps = np.array([axis.microstep for axis in self.settings.axes])
            self._queue.append((np.round(target / steps) * steps, self._feed / 60))
            self._update()
        return b"ok"

    def _goal(self) -> Array:
        return self._machine if self._line is None else self._line.at(self._line.began_s + self._line.motion.duration)

    def _update(self) -> None:
        """Bring the machine to this moment: end lines that are over, begin the next."""
        now = self.clock.now()
        if self._line is not None and not self.jammed:
            self._machine = self._line.at(now)
            ends = self._line.began_s + self._line.motion.duration
            if now >= ends:
                self._line, now = None, ends
        while self._line is None and self._queue and self.state != "Hold":
            target, feed = self._queue.pop(0)
            way = target - self._machine
            length = float(np.linalg.norm(way))
            if length < 1e-9:
                continue
            direction = way / length
            with np.errstate(divide="ignore"):
                top = min(
                    feed, *(a.max_speed / abs(d) for a, d in zip(self.settings.axes, direction, strict=True) if d)
                )
                strength = min(a.acceleration / abs(d) for a, d in zip(self.settings.axes, direction, strict=True) if d)
            self._line = _Line(self._machine, direction, move(0.0, length, speed=top, acceleration=strength), now)

    def _hold(self) -> None:
        if self.state == "Alarm":
            return
        self.state = "Hold"
        self._queue.clear()
        if self._line is not None:
            now = self.clock.now()
            place, speed = self._line.motion.state(now - self._line.began_s)
            strength = max(abs(piece.acceleration) for piece in self._line.motion.pieces)
            self._line = replace(self._line, motion=brake(place, speed, strength), began_s=now)


def serve_grbl(port: int, *, settings: GrblSettings | None = None, speed_factor: float = 1.0) -> None:
    """Run a simulated GRBL controller until Ctrl-C; prints where it listens."""
    simulator = GrblSimulator(settings or GrblSettings(), ScaledClock(speed_factor))
    host, bound = simulator.start(port)
    print(f"simulated GRBL {simulator.settings.version} on {host}:{bound} - Ctrl-C ends it", flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        print("stopped", flush=True)
    finally:
        simulator.close()
