"""Axes as they reported themselves: counts and readings, limits, speeds, firmware."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from eddyscan.core.errors import DeviceError, LinkError, TravelError
from eddyscan.core.frames import Array
from eddyscan.devices.drivers.zaber_link import ZaberLink
from eddyscan.devices.drivers.zaber_settings import ZaberAxis, ZaberStageSettings
from eddyscan.devices.protocols import Axis
from eddyscan.devices.trapezoid import rest_to_rest_s

SPEED_UNIT = 1.6384  # native speed = microsteps/s x this (vendor's documented conversion)
ACCELERATION_UNIT = 1.6384 / 1e4
READ_AT_CONNECT = ("deviceid", "system.serial", "version", "limit.min", "limit.max", "maxspeed", "accel", "resolution")
DEVICE_WIDE = ("deviceid", "system.serial", "version")
HARMLESS = ("--", "NI", "NC", "NJ", "ND")
MEANINGS = {
    "FS": "a stall (FS)",
    "FQ": "an encoder error (FQ)",
    "FD": "its driver off (FD)",
    "FE": "a limit error (FE)",
    "WL": "an unexpected limit (WL)",
    "WR": "a lost reference (WR)",
    "WH": "that it was never homed (WH)",
}


@dataclass
class ConnectedAxis:
    """One axis of the table with what the device said about itself."""

    table: ZaberAxis
    reported: dict[str, str]
    last_count: int = 0
    _changed: dict[str, str] = field(default_factory=dict)

    @property
    def where(self) -> tuple[int, int]:
        """Return (device address, axis number)."""
        return self.table.device, self.table.axis

    @property
    def takes_speed_with_move(self) -> bool:
        """Return whether the firmware accepts speed and acceleration in the move command (7 and later)."""
        return int(self.reported["version"].split(".")[0]) >= 7

    @property
    def max_speed(self) -> float:
        """Return the largest allowed speed [unit/s]."""
        own = float(self.reported["maxspeed"]) / SPEED_UNIT * self.table.microstep
        return min(own, self.table.max_speed) if self.table.max_speed else own

    @property
    def acceleration(self) -> float:
        """Return the acceleration [unit/s^2]."""
        told = float(self.reported["accel"]) / ACCELERATION_UNIT * self.table.microstep
        return told or self.table.acceleration

    def described(self) -> Axis:
        """Return the axis as the protocols describe it."""
        ends = sorted(self.reading(round(float(self.reported[k]))) for k in ("limit.min", "limit.max"))
        t = self.table
        return Axis(t.name, ends[0], ends[1], t.microstep, self.max_speed, self.acceleration, t.unit)

    def reading(self, count: float) -> float:
        """Return the stage reading [unit] at a count."""
        top = float(self.reported["limit.max"])
        return self.table.lower + (top - count if self.table.inverted else count) * self.table.microstep

    def checked_count(self, reading: float) -> int:
        """Return the count for a stage reading, or raise TravelError."""
        least, most = float(self.reported["limit.min"]), float(self.reported["limit.max"])
        native = (reading - self.table.lower) / self.table.microstep
        native = most - native if self.table.inverted else native
        if not least - 0.5 <= native <= most + 0.5:
            axis = self.described()
            raise TravelError(
                f"target {reading:.3f} {axis.unit} of axis {axis.name} is outside its travel "
                f"{axis.lower:.3f} to {axis.upper:.3f} {axis.unit}. Move the part on the stage, or inspect less of it."
            )
        return int(np.clip(round(native), least, most))

    def heard(self, data: str) -> None:
        """Keep the count an answer told, or raise LinkError when it is none."""
        try:
            self.last_count = int(data)
        except ValueError:
            raise LinkError(
                f"axis {self.table.name} answered {data!r} where a position was expected. "
                "Check the cable; run again, everything recorded so far is kept."
            ) from None

    def start_move(self, link: ZaberLink, count: int, plan: Arrival) -> None:
        """Send the axis on its way; with firmware 6 the speed goes ahead as a setting."""
        speed, acceleration = plan.native(self)
        if self.takes_speed_with_move:
            link.act(
                *self.where,
                f"move abs {count}",
                lambda a: a.move_absolute(count, velocity=speed, acceleration=acceleration, wait_until_idle=False),
            )
            return
        self.set(link, "maxspeed", speed)
        self.set(link, "accel", acceleration)
        link.act(*self.where, f"move abs {count}", lambda a: a.move_absolute(count, wait_until_idle=False))

    def send_on(self, link: ZaberLink, count: int, native_speed: int) -> None:
        """Send an axis that may be moving to a new target at a new speed.

        As a plain line: the library's own call would spend a second one on
        clearing the flag that a pre-empted move raises.
        """
        if self.takes_speed_with_move:
            link.tell(*self.where, f"move abs {count} {native_speed}")
            return
        self.set(link, "maxspeed", native_speed)
        link.tell(*self.where, f"move abs {count}")

    def native_speed(self, speed: float) -> int:
        """Return a signed speed [unit/s] in the device's units and direction."""
        native = round(speed / self.table.microstep * SPEED_UNIT)
        return -native if self.table.inverted else native

    def set(self, link: ZaberLink, name: str, value: int) -> None:
        """Change a setting of the device, remembering what it was."""
        if self._changed.get(name, self.reported[name]) != str(value):
            link.tell(*self.where, f"set {name} {value}")
            self._changed[name] = str(value)

    def restore(self, link: ZaberLink) -> None:
        """Give the device its own settings back; a dead line is no reason to fail."""
        for name in list(self._changed):
            try:
                link.tell(*self.where, f"set {name} {self.reported[name]}")
            except DeviceError:
                return
            del self._changed[name]

    @staticmethod
    def meaning(flag: str) -> str:
        """Return a warning flag in words."""
        return MEANINGS.get(flag, f"the warning {flag}")


@dataclass(frozen=True)
class Arrival:
    """Speeds and accelerations with which all axes arrive together.

    `share` holds each axis' part of the longest way; speeds and accelerations
    scale with it, so every axis draws the same profile over the same time.
    """

    axes: tuple[ConnectedAxis, ...]
    distances: Array
    rate: float
    rate_change: float
    duration_s: float

    def native(self, axis: ConnectedAxis) -> tuple[int, int]:
        """Return (speed, acceleration) of an axis in the device's units, at least 1 each."""
        distance = float(self.distances[self.axes.index(axis)])
        speed = distance * self.rate / axis.table.microstep * SPEED_UNIT
        acceleration = distance * self.rate_change / axis.table.microstep * ACCELERATION_UNIT
        return max(round(speed), 1), max(round(acceleration), 1)


def speeds_to_arrive_together(axes: Sequence[ConnectedAxis], steps: Array, speed: float | None) -> Arrival:
    """Scale speeds so that a straight line is driven: no axis exceeds its own limits, the path not `speed`."""
    distances = np.abs(np.array([axis.table.microstep for axis in axes]) * steps)
    moving = [i for i in range(len(axes)) if distances[i] > 0]
    if not moving:
        return Arrival(tuple(axes), distances, 1.0, 1.0, 0.0)
    rates = [axes[i].max_speed / distances[i] for i in moving]
    if speed is not None:
        rates.append(speed / float(np.linalg.norm(distances)))
    rate = float(min(rates))
    rate_change = float(min(axes[i].acceleration / distances[i] for i in moving))
    return Arrival(tuple(axes), distances, rate, rate_change, rest_to_rest_s(1.0, rate, rate_change))


def connect_axes(link: ZaberLink, settings: ZaberStageSettings) -> list[ConnectedAxis]:
    """Read every axis' settings and check its travel against the table."""
    axes = []
    for table in settings.axes:
        reported = {
            name: link.tell(
                table.device, 0 if name in DEVICE_WIDE else table.axis, f"get {name}", retries=settings.read_retries
            ).data
            for name in READ_AT_CONNECT
        }
        axis = ConnectedAxis(table, reported)
        told = (float(reported["limit.max"]) - float(reported["limit.min"])) * table.microstep
        if abs(told - table.travel) > 0.01 * table.travel:
            raise DeviceError(
                f"axis {table.name} (device {table.device}) reports {told:.2f} {table.unit} of travel, the rig file "
                f"says {table.travel:.2f}. Check the order of the chain and the microstep size in rig.toml."
            )
        axis.heard(link.tell(*axis.where, "get pos", retries=settings.read_retries).data)
        axes.append(axis)
    return axes
