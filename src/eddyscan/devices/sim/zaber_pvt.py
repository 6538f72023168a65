"""Timed points on a multi-axis controller: position, velocity and time, joined by cubics."""

from __future__ import annotations

from collections.abc import Sequence

from eddyscan.devices.sim.zaber_axis import SPEED_UNIT, AxisState
from eddyscan.devices.sim.zaber_settings import GuessedFirmware
from eddyscan.devices.sim.zaber_wire import Answer

REFUSED = Answer("BADDATA", rejected=True)
UNKNOWN = Answer("BADCOMMAND", rejected=True)
AGAIN = Answer("AGAIN", rejected=True)
State = tuple[float, float]


class PvtSequence:
    """One sequence: a queue of segments that its axes play together."""

    def __init__(self, axes: Sequence[AxisState], guessed: GuessedFirmware) -> None:
        self._all, self._guessed = list(axes), guessed
        self._axes: list[AxisState] = []
        self._segments: list[tuple[float, list[State], list[State]]] = []
        self._ends: list[State] = []
        self._began: float | None = None
        self._corked = False

    def handle(self, words: tuple[str, ...], now: float) -> Answer:
        """Act on `pvt <number> ...` (the words after `pvt`)."""
        if len(words) < 2 or words[0] != "1":
            return REFUSED
        self.update(now)
        verb, rest = words[1], words[2:]
        if verb == "setup":
            return self._setup(rest, now)
        if verb == "point" and self._axes:
            return self._point(rest, now)
        if verb == "fifo" and rest in (("cork",), ("uncork",)):
            self._corked = rest == ("cork",)
            if not self._corked and self._segments:
                self._start(now)
            return Answer()
        if verb == "info":
            return Answer("disabled" if not self._axes else "live")
        return UNKNOWN

    def disable(self, now: float) -> None:
        """Drop the queue and let the axes brake."""
        if self._began is not None:
            for axis in self._axes:
                axis.leave_path(now)
        self._axes, self._segments, self._began, self._corked = [], [], None, False

    def update(self, now: float) -> None:
        """Drop segments that are over; end the motion when the queue ran dry."""
        if self._began is None:
            return
        while self._segments and now - self._began >= self._segments[0][0]:
            duration, _, ends = self._segments[0]
            if len(self._segments) == 1:
                self._run_dry(self._began + duration, ends)
                return
            self._segments.pop(0)
            self._began += duration
            self._follow()

    def _run_dry(self, when: float, ends: list[State]) -> None:
        moving = any(abs(velocity) > 1.0 for _, velocity in ends)
        for axis, (position, _) in zip(self._axes, ends, strict=True):
            if moving and self._guessed.pvt_starvation == "brake":
                axis.leave_path(when)
            else:
                axis.halt(when, at=position)
        self._segments, self._began, self._ends = [], None, []

    def _setup(self, words: tuple[str, ...], now: float) -> Answer:
        self.disable(now)
        if words == ("disable",):
            return Answer()
        if len(words) < 2 or words[0] != "live" or not all(w.isascii() and w.isdigit() for w in words[1:]):
            return REFUSED
        numbers = [int(word) for word in words[1:]]
        if any(not 1 <= n <= len(self._all) for n in numbers):
            return Answer("BADAXIS", rejected=True)
        self._axes, self._ends = [self._all[n - 1] for n in numbers], []
        return Answer()

    def _point(self, words: tuple[str, ...], now: float) -> Answer:
        n = len(self._axes)
        expected = 5 + 2 * n
        if len(words) != expected or words[0] != "abs" or words[1] != "p" or words[2 + n] != "v" or words[-2] != "t":
            return REFUSED
        try:
            positions = [float(w) for w in words[2 : 2 + n]]
            velocities = [float(w) / SPEED_UNIT for w in words[3 + n : 3 + 2 * n]]
            duration = float(words[-1]) / 1e3
        except ValueError:
            return REFUSED
        if duration <= 0 or any(not 0 <= p <= a.limit_max for p, a in zip(positions, self._axes, strict=True)):
            return REFUSED
        if len(self._segments) >= self._guessed.pvt_queue:
            return AGAIN
        starts = self._ends or [(axis.state(now)[0], 0.0) for axis in self._axes]
        self._ends = list(zip(positions, velocities, strict=True))
        self._segments.append((duration, starts, self._ends))
        if self._began is None and not self._corked:
            self._start(now)
        return Answer()

    def _start(self, now: float) -> None:
        self._began = now
        self._follow()

    def _follow(self) -> None:
        assert self._began is not None
        duration, starts, ends = self._segments[0]
        for index, axis in enumerate(self._axes):
            axis.follow(_Cubic(duration, starts[index], ends[index]), self._began)


class _Cubic:
    """The cubic with given position and velocity at both ends of a time."""

    def __init__(self, duration: float, start: State, end: State) -> None:
        (p0, v0), (p1, v1) = start, end
        rise = p1 - p0
        self.duration, self.p0, self.v0 = duration, p0, v0
        self.c2 = (3 * rise - (2 * v0 + v1) * duration) / duration**2
        self.c3 = ((v0 + v1) * duration - 2 * rise) / duration**3

    def __call__(self, elapsed: float) -> State:
        t = min(max(elapsed, 0.0), self.duration)
        position = self.p0 + t * (self.v0 + t * (self.c2 + t * self.c3))
        return position, self.v0 + t * (2 * self.c2 + t * 3 * self.c3)
