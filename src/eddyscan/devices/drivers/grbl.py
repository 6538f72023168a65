"""GRBL and FluidNC machines over serial or TCP: straight moves in machine coordinates."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Sequence

import numpy as np
from pydantic import Field, model_validator

from eddyscan.core.errors import LinkError, MotionError, TravelError
from eddyscan.core.frames import Array
from eddyscan.core.technique import Section
from eddyscan.devices.dead_man import DeadMan
from eddyscan.devices.link import Link, SerialLink, TcpLink
from eddyscan.devices.protocols import Axis, Clock, Identity
from eddyscan.devices.trapezoid import rest_to_rest_s

LOOK_S, SOON_S = 0.1, 0.005
HOMING_TIMEOUT_S = 120.0
STATUS = re.compile(rb"<(\w+)(?::(\d))?\|MPos:([-\d.,]+)")


class GrblStageSettings(Section):
    """How to reach the machine; limits, speeds and steps are read from it ($$)."""

    host: str | None = Field(None, description="TCP address; leave out for a serial port")
    port: int = Field(23, ge=1, le=65535)
    serial_port: str | None = None
    baud_rate: int = 115200
    axes: tuple[str, ...] = Field(
        ("x", "y", "z"), description="in the machine's order; a fourth, a or b, is in degrees"
    )
    lower: tuple[float, ...] = Field((0.0, 0.0, 0.0), description="stage reading at the lower end of each travel")
    tolerance: float = Field(0.005, gt=0, description="[mm or deg] largest distance to the target after a move")
    no_progress_s: float = Field(1.0, gt=0)
    answer_timeout_s: float = Field(2.0, gt=0, description="wall time to wait for a line")
    dead_man: bool = Field(True, description="a second process holds the machine when this one is killed")

    @model_validator(mode="after")
    def _one_way_in(self) -> GrblStageSettings:
        if (self.host is None) == (self.serial_port is None):
            raise ValueError("give either host (TCP) or serial_port, not both and not neither")
        if len(self.lower) != len(self.axes):
            raise ValueError(f"lower has {len(self.lower)} values for {len(self.axes)} axes")
        return self


class GrblStage:
    """A machine that speaks GRBL 1.1; unverified on hardware. Its upper ends of travel are machine 0."""

    def __init__(self, settings: GrblStageSettings, clock: Clock, *, link: Link | None = None) -> None:
        self.settings, self.clock = settings, clock
        self._owner = threading.RLock()
        self._stops = 0
        self._link = link or self._open()
        self._dollar = self._read_settings()
        n = len(settings.axes)
        self._steps, self._speed, self._strength, self._travel = (
            np.array([self._dollar.get(base + k, np.nan) for k in range(n)]) for base in (100, 110, 120, 130)
        )
        if np.isnan([self._steps, self._speed, self._strength, self._travel]).any():
            raise MotionError(
                f"the machine reports no steps, speed or travel for one of {settings.axes}; see $100-$133."
            )
        self._lower, self._speed = np.array(settings.lower), self._speed / 60.0
        where = (settings.host, settings.port) if settings.host else str(settings.serial_port)
        self._dead_man = DeadMan(where, b"!") if settings.dead_man and link is None else None

    def identity(self) -> Identity:
        """Return the firmware's word about itself and all its settings."""
        told = tuple((f"${number}", f"{value:g}") for number, value in sorted(self._dollar.items()))
        return Identity("grbl", "GRBL machine", "not told", self._version, verified=False, settings=told)

    def axes(self) -> Sequence[Axis]:
        """Return the axes as the machine's settings describe them [mm or deg]."""
        return tuple(
            Axis(
                name=name,
                lower=float(self._lower[k]),
                upper=float(self._lower[k] + self._travel[k]),
                resolution=float(1 / self._steps[k]),
                max_speed=float(self._speed[k]),
                acceleration=float(self._strength[k]),
                unit="deg" if name in "abc" else "mm",
            )
            for k, name in enumerate(self.settings.axes)
        )

    def home(self) -> None:
        """Run the machine's homing cycle ($H): z first is the firmware's default."""
        with self._owner:
            self._leave_hold()
            self._send("$H", HOMING_TIMEOUT_S)

    def is_homed(self) -> bool:
        """Return whether the machine has its reference: GRBL stays in alarm until it has."""
        with self._owner:
            return self._status()[0] != "Alarm"

    def move(self, target: Array, speed: float | None = None) -> None:
        """Move all axes to `target` in a straight line, watch the progress and verify."""
        machine = self._checked(target)
        with self._owner:
            stops = self._stops
            self._leave_hold()
            way = machine - self._status()[1]
            length = float(np.linalg.norm(way))
            share = np.abs(way) / max(length, 1e-12)
            with np.errstate(divide="ignore"):
                top = min(speed or np.inf, float((self._speed / share).min()))
                strength = float((self._strength / share).min())
            words = " ".join(
                f"{name.upper()}{value:.4f}" for name, value in zip(self.settings.axes, machine, strict=True)
            )
            if length > 1e-6:
                self._send(f"G53 G1 {words} F{60 * top:.3f}")
                self._wait(stops, rest_to_rest_s(length, top, strength))
            self._verify(machine)

    def position(self) -> Array:
        """Return the positions (n_axes,) the controller counts [mm or deg]."""
        with self._owner:
            return np.asarray(self._status()[1] + self._travel + self._lower)

    def stop(self) -> None:
        """Hold the feed at once; the next move clears the hold."""
        self._stops += 1
        self._link.write(b"!")

    def close(self) -> None:
        """Close the link; more than once is fine."""
        self._link.close()
        if self._dead_man is not None:
            self._dead_man.dismiss()

    # -- the wire -------------------------------------------------------------

    def _open(self) -> Link:
        s = self.settings
        return TcpLink(s.host, s.port) if s.host is not None else SerialLink(str(s.serial_port), s.baud_rate)

    def _read_settings(self) -> dict[int, float]:
        self._version = "not told"
        with contextlib.suppress(LinkError):  # a serial GRBL that was already running says nothing
            while not (line := self._link.read_line(self.settings.answer_timeout_s)).startswith(b"Grbl"):
                pass
            self._version = line.decode("latin-1").split(" [")[0]
        return {
            int(number): float(value) for number, value in re.findall(r"\$(\d+)=([-\d.]+)", "\n".join(self._send("$$")))
        }

    def _send(self, line: str, timeout_s: float | None = None) -> list[str]:
        """Send a line and return what came before its ok."""
        self._link.write(line.encode() + b"\n")
        said: list[str] = []
        while True:
            heard = self._link.read_line(timeout_s or self.settings.answer_timeout_s).decode("latin-1")
            if heard == "ok":
                return said
            if heard.startswith(("error:", "ALARM:")):
                raise MotionError(
                    f"the machine answered {heard} to {line!r} (github.com/gnea/grbl/wiki lists the numbers). "
                    "Home it, then run again."
                )
            said.append(heard)

    def _status(self) -> tuple[str, Array]:
        """Return the state and the machine position."""
        self._link.write(b"?")
        while True:
            heard = self._link.read_line(self.settings.answer_timeout_s)
            if found := STATUS.match(heard):
                place = np.array([float(v) for v in found[3].split(b",")])[: len(self.settings.axes)]
                state = found[1].decode() + (f":{found[2].decode()}" if found[2] else "")
                return state, place
            if heard.startswith(b"ALARM"):
                raise MotionError(f"the machine reports {heard.decode()}. Free it, home it and run again.")

    def _leave_hold(self) -> None:
        """Drop what a stop left in the planner; at rest a soft reset keeps the position."""
        while (state := self._status()[0]).startswith("Hold"):
            if state == "Hold:0":
                self._link.write(b"\x18")
            self.clock.sleep(SOON_S)

    def _wait(self, stops: int, expected_s: float) -> None:
        arrival, seen, seen_at = self.clock.now() + expected_s, self._status()[1], self.clock.now()
        while True:
            left = arrival - self.clock.now()
            self.clock.sleep(min(left, LOOK_S) if left > 0 else SOON_S)
            state, place = self._status()
            if stops != self._stops:
                raise MotionError("the stage was stopped on request. Check the probe, then move again.")
            if state == "Idle":
                return
            if state == "Alarm" or state.startswith("Door"):
                raise MotionError(f"the machine went into {state}. Free it, home it and run again.")
            if (place != seen).any():
                seen, seen_at = place, self.clock.now()
            elif self.clock.now() - seen_at > self.settings.no_progress_s:
                self.stop()
                raise MotionError(
                    f"the machine says {state} but covered nothing for {self.settings.no_progress_s:g} s; it was told "
                    "to hold. Free it, home it and run again."
                )

    def _checked(self, target: Array) -> Array:
        values = np.asarray(target, dtype=np.float64)
        if values.shape != (len(self.settings.axes),) or not np.isfinite(values).all():
            raise MotionError(f"a target for this stage has {len(self.settings.axes)} finite values, not {values}.")
        for axis, value in zip(self.axes(), values, strict=True):
            if not axis.lower - axis.resolution <= value <= axis.upper + axis.resolution:
                raise TravelError(
                    f"target {value:.3f} {axis.unit} of axis {axis.name} is outside its travel {axis.lower:.3f} to "
                    f"{axis.upper:.3f} {axis.unit}. Move the part on the stage, or inspect less of it."
                )
        machine = values - self._lower - self._travel
        return np.asarray(np.clip(np.round(machine * self._steps) / self._steps, -self._travel, 0.0))

    def _verify(self, machine: Array) -> None:
        off = self._status()[1] - machine
        worst = int(np.abs(off).argmax())
        if abs(off[worst]) > self.settings.tolerance:
            raise MotionError(
                f"axis {self.settings.axes[worst]} stands {off[worst]:+.4f} from its target (limit "
                f"{self.settings.tolerance:g}): the move was stopped or steps were lost. Home the machine, "
                "run again."
            )
