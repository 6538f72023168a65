"""A driver for a stage of your own: copy it, put in your device's words, run the contract suite on it.

The made-up controller answers one line to each line: `AXES` (name lower upper
speed, one axis after the other), `POS`, `HOME`, `MOVE x y z speed`, `BUSY`, `STOP`.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from eddyscan.core.errors import LinkError, MotionError, TravelError
from eddyscan.core.frames import Array
from eddyscan.devices.link import TcpLink
from eddyscan.devices.protocols import Axis, Clock, Identity

LOOK_S, NO_PROGRESS_S, TOLERANCE_MM = 0.05, 1.0, 0.005


class MyStage:
    """Three axes behind a TCP port; bigger z is further from the part."""

    def __init__(self, address: str, clock: Clock) -> None:
        host, port = address.rsplit(":", 1)
        self.clock, self._link, self._owner, self._stops = clock, TcpLink(host, int(port)), threading.RLock(), 0
        words = self._ask("AXES").split()
        self._axes = tuple(
            Axis(name, float(lower), float(upper), 0.001, float(speed), 100.0)
            for name, lower, upper, speed in zip(*[iter(words)] * 4, strict=True)
        )

    def identity(self) -> Identity:
        return Identity(kind="my-stage", model="made up", serial="1", verified=False)

    def axes(self) -> Sequence[Axis]:
        return self._axes

    def home(self) -> None:
        self._ask("HOME")
        self._wait(self._stops)

    def is_homed(self) -> bool:
        return self._ask("POS") != "UNKNOWN"

    def move(self, target: Array, speed: float | None = None) -> None:
        goal = self._checked(target)
        with self._owner:
            stops, top = self._stops, speed or min(axis.max_speed for axis in self._axes)
            self._ask("MOVE " + " ".join(f"{value:.4f}" for value in (*goal, top)))
            self._wait(stops)
            off = self.position() - goal
        if np.abs(off).max() > TOLERANCE_MM:
            worst = int(np.abs(off).argmax())
            raise MotionError(f"axis {self._axes[worst].name} stands {off[worst]:+.4f} mm from its target; home it.")

    def position(self) -> Array:
        return np.array([float(value) for value in self._ask("POS").split()])

    def stop(self) -> None:
        self._stops += 1
        self._link.write(b"STOP\n")  # the device sends no answer to this one

    def close(self) -> None:
        self._link.close()

    def _ask(self, line: str) -> str:
        with self._owner:
            self._link.write(line.encode() + b"\n")
            answer = self._link.read_line(2.0).decode()
        if answer.startswith("ERROR"):
            raise MotionError(f"the stage answered {answer!r} to {line!r}. Home it, then run again.")
        if not answer:
            raise LinkError(f"the stage answered nothing to {line!r}. Check the cable.")
        return answer

    def _wait(self, stops: int) -> None:
        seen, seen_at = self._ask("POS"), self.clock.now()
        while self._ask("BUSY") == "1":
            self.clock.sleep(LOOK_S)
            if (here := self._ask("POS")) != seen:
                seen, seen_at = here, self.clock.now()
            elif self.clock.now() - seen_at > NO_PROGRESS_S:
                self.stop()
                raise MotionError(f"the stage moves nothing for {NO_PROGRESS_S:g} s at {seen}; it was stopped.")
        if stops != self._stops:
            raise MotionError("the stage was stopped on request. Check the probe, then move again.")

    def _checked(self, target: Array) -> Array:
        goal = np.asarray(target, dtype=np.float64)
        if goal.shape != (len(self._axes),) or not np.isfinite(goal).all():
            raise MotionError(f"a target has {len(self._axes)} finite values, not {goal}.")
        for axis, value in zip(self._axes, goal, strict=True):
            if not axis.lower <= value <= axis.upper:
                raise TravelError(
                    f"target {value:.3f} mm of axis {axis.name} is outside {axis.lower:.3f} to {axis.upper:.3f} mm."
                )
        return goal
