"""One simulated axis: motion in microsteps, limits, warnings, stalls and its hidden true position."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from eddyscan.devices.sim.zaber_settings import GuessedFirmware, SimulatedAxis
from eddyscan.devices.trapezoid import Motion, brake, move

SPEED_UNIT = 1.6384
ACCELERATION_UNIT = 1.6384 / 1e4
PRIORITY = ("FD", "FS", "FQ", "WL", "WR", "NI", "NC")
Path = Callable[[float], tuple[float, float]]


class AxisState:
    """Counts, motion and flags of one axis.

    `counted` is what the controller believes, physical position is `counted +
    lost` (a power cycle loses the difference). All positions are microsteps.
    """

    def __init__(self, model: SimulatedAxis, guessed: GuessedFirmware, rng: np.random.Generator) -> None:
        self.model, self.guessed = model, guessed
        self.limit_max = round(model.travel / model.microstep)
        self._motion = Motion(float(round(self.count_of(model.start))))
        self._began = 0.0
        self._path: tuple[Path, float] | None = None
        self.lost = 0.0
        self.homed = False
        self.homing = False
        self.driver_on = True
        self.flags: set[str] = {"WR"}
        self.settings = {
            "maxspeed": round(model.max_speed / model.microstep * SPEED_UNIT),
            "accel": max(round(model.acceleration / model.microstep * ACCELERATION_UNIT), 1),
        }
        self._stall: tuple[float, float] | None = None
        self.busy = False
        self.direction = 1.0
        self._rng = rng
        self._waves = error_waves(model.accuracy, rng)

    # -- where it is -------------------------------------------------------

    def state(self, now: float) -> tuple[float, float]:
        """Return (count, speed) in microsteps and microsteps per second."""
        if self._path is not None:
            path, began = self._path
            return path(now - began)
        return self._motion.state(now - self._began)

    def count(self, now: float) -> int:
        """Return the position the controller reports."""
        return round(self.state(now)[0])

    def true_reading(self, now: float) -> float:
        """Return the hidden true stage reading [unit]: microsteps, error map, backlash and noise."""
        count, speed = self.state(now)
        if speed:
            self.direction = float(np.sign(speed))
        physical = round(count + self.lost) * self.model.microstep
        phase = 2 * np.pi * physical / self.model.travel
        error = sum(size * (np.sin(k * phase + shift) - np.sin(shift)) for k, size, shift in self._waves)
        error += -self.direction * self.model.backlash / 2 + self._rng.normal(0.0, self.model.noise)
        native = physical + float(error)
        top = self.limit_max * self.model.microstep
        return self.model.lower + (top - native if self.model.inverted else native)

    def count_of(self, reading: float) -> float:
        """Return the count at a stage reading [unit]."""
        native = (reading - self.model.lower) / self.model.microstep
        return self.limit_max - native if self.model.inverted else native

    # -- what it does ------------------------------------------------------

    def update(self, now: float) -> bool:
        """Bring flags and business up to `now`; return True when the axis has just come to rest."""
        if not self.busy:
            return False
        if self._stall is not None:
            place, side = self._stall
            if (self.state(now)[0] - place) * side >= 0:
                self.halt(now, at=place)
                self.flags |= {"FS", "NI"}
                self._stall = None
                return True
        if self._path is None and now - self._began >= self._motion.duration:
            self.busy = False
            if self.homing:
                self.homing, self.homed = False, True
                self.flags.discard("WR")
            return True
        return False

    def go(self, target: float, now: float, *, speed: float | None = None, acceleration: float | None = None) -> None:
        """Begin a move to `target`, from whatever speed the axis has."""
        self._preempt()
        count, velocity = self.state(now)
        self._begin(
            move(
                count,
                float(target),
                speed=speed or self.settings["maxspeed"] / SPEED_UNIT,
                acceleration=(acceleration or self.settings["accel"]) / ACCELERATION_UNIT,
                velocity=velocity,
            ),
            now,
        )

    def home(self, now: float) -> None:
        """Seek the lower end switch; the count becomes 0 there."""
        count, _ = self.state(now)
        self.halt(now, at=count + self.lost)
        self.lost = 0.0
        self.go(0.0, now)
        self.homing = True

    def stop(self, now: float) -> None:
        """Brake at the axis' acceleration."""
        self._preempt()
        count, velocity = self.state(now)
        self._begin(brake(count, velocity, self.settings["accel"] / ACCELERATION_UNIT), now)
        self.homing = False

    def halt(self, now: float, at: float | None = None) -> None:
        """Stand still at once."""
        where = self.state(now)[0] if at is None else at
        self._motion, self._began, self._path = Motion(where), now, None
        self.busy = self.homing = False

    def follow(self, path: Path, now: float) -> None:
        """Move along a function of elapsed seconds until told otherwise."""
        self._path, self.busy = (path, now), True

    def leave_path(self, now: float) -> None:
        """Brake from the path to rest."""
        count, velocity = self.state(now)
        self._path = None
        self._begin(brake(count, velocity, self.settings["accel"] / ACCELERATION_UNIT), now)

    def stall_at(self, now: float, reading: float | None) -> None:
        """Let the axis stall when it next comes to a stage reading (None: where it is, when it moves)."""
        count = self.state(now)[0]
        place = count if reading is None else self.count_of(reading)
        self._stall = (place, float(np.sign(place - count)))

    def power_cycle(self, now: float) -> None:
        """Lose the reference, as when the supply was cut."""
        count = self.state(now)[0]
        if self.guessed.position_after_power_cycle == "zero":
            self.lost += count
            count = 0.0
        self.halt(now, at=count)
        self.homed, self.flags, self.driver_on = False, {"WR"}, True

    def warning(self) -> str:
        """Return the most urgent flag, or two dashes."""
        flags = self.flags | (set() if self.driver_on else {"FD"})
        return next((flag for flag in PRIORITY if flag in flags), "--")

    def clear_flags(self) -> str:
        """Return all flags as the protocol prints them, and clear those that a person may clear."""
        printed = self.all_flags()
        self.flags = {"WR"} if not self.homed else set()
        return printed

    def all_flags(self) -> str:
        """Return the number of flags and the flags."""
        flags = [f for f in PRIORITY if f in self.flags or (f == "FD" and not self.driver_on)]
        return " ".join([f"{len(flags):02d}", *flags])

    def _preempt(self) -> None:
        if self.busy and self.guessed.stop_sets_ni:
            self.flags.add("NI")
        self.homing = False

    def _begin(self, motion: Motion, now: float) -> None:
        self._motion, self._began, self._path, self.busy = motion, now, None, True


def error_waves(accuracy: float, rng: np.random.Generator) -> list[tuple[int, float, float]]:
    """Return (waves over the travel, size, phase) of a smooth error whose peak-to-peak is `accuracy`."""
    waves = [(k, 1.0 / k, float(rng.uniform(0, 2 * np.pi))) for k in (1, 2, 3, 5)]
    grid = np.linspace(0, 2 * np.pi, 721)
    total = sum(size * np.sin(k * grid + shift) for k, size, shift in waves)
    span = float(np.ptp(np.asarray(total)))
    return [(k, size * accuracy / span, shift) for k, size, shift in waves]
