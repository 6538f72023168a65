"""One simulated device on the chain: it answers commands for its axes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from eddyscan.devices.sim.zaber_axis import PRIORITY, AxisState
from eddyscan.devices.sim.zaber_pvt import PvtSequence
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.devices.sim.zaber_wire import Answer, Command

BAD_COMMAND = Answer("BADCOMMAND", rejected=True)
BAD_DATA = Answer("BADDATA", rejected=True)
DRIVER_DISABLED = Answer("DRIVERDISABLED", rejected=True)
BAD_AXIS = Answer("BADAXIS", rejected=True)
FIRMWARE_7 = {
    "comm.packet.size.max": "80",
    "device.hw.modified": "0",
    "comm.command.packets.max": "5",
    "comm.word.size.max": "50",
}
WRITABLE = ("maxspeed", "accel", "comm.alert")


class Device:
    """An integrated stage, or a controller with several axes."""

    def __init__(self, number: int, axes: Sequence[AxisState], settings: ZaberSettings) -> None:
        self.number, self.axes, self.settings = number, list(axes), settings
        self.alerts_on = False
        self.pvt = PvtSequence(self.axes, settings.guessed)
        self._verbs: dict[str, Callable[[Command, list[AxisState], float], Answer]] = {
            "get": self._get,
            "set": self._set,
            "home": self._home,
            "move": self._move,
            "stop": self._stop,
            "estop": self._estop,
            "warnings": self._warnings,
            "driver": self._driver,
            "io": self._io,
        }

    def handle(self, command: Command, now: float) -> Answer:
        """Act on one command and return what to say."""
        if command.axis > len(self.axes):
            return BAD_AXIS
        axes = self.axes if command.axis == 0 else [self.axes[command.axis - 1]]
        if not command.words:
            return Answer()
        verb = command.words[0]
        if verb == "pvt" and self.has_pvt:
            return self.pvt.handle(command.words[1:], now)
        handler = self._verbs.get(verb)
        return BAD_COMMAND if handler is None else handler(command, axes, now)

    @property
    def has_pvt(self) -> bool:
        """Return whether this device plays timed points: a controller with firmware 7."""
        return self.settings.layout == "mcc" and self.settings.firmware.startswith("7")

    def update(self, now: float) -> list[int]:
        """Bring all axes up to `now`; return the numbers of those that have just come to rest."""
        self.pvt.update(now)
        rested = [number for number, axis in enumerate(self.axes, 1) if axis.update(now)]
        if any("FS" in axis.flags or not axis.driver_on for axis in self.axes):
            self.pvt.disable(now)
        return rested

    def power_cycle(self, now: float) -> None:
        """Forget sequences, alerts and the reference, as when the supply was cut."""
        self.pvt.disable(now)
        self.alerts_on = False
        for axis in self.axes:
            axis.power_cycle(now)

    def busy(self, axis: int) -> bool:
        """Return whether the axis (0: any) moves."""
        return any(a.busy for a in self._addressed(axis))

    def warning(self, axis: int) -> str:
        """Return the most urgent flag of the axis (0: of all)."""
        shown = {a.warning() for a in self._addressed(axis)}
        return next((flag for flag in PRIORITY if flag in shown), "--")

    def _addressed(self, axis: int) -> list[AxisState]:
        return self.axes if axis == 0 or axis > len(self.axes) else [self.axes[axis - 1]]

    def _get(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if len(command.words) != 2:
            return BAD_COMMAND
        name = command.words[1]
        device_wide = self._device_setting(name)
        if device_wide is not None:
            return Answer(device_wide)
        values = [self._axis_setting(name, axis, now) for axis in axes]
        if any(value is None for value in values):
            return BAD_COMMAND
        return Answer(" ".join(str(value) for value in values))

    def _device_setting(self, name: str) -> str | None:
        first = self.axes[0].model
        version, build = (("7.38", "16000"), ("6.28", "1347"))[self.settings.firmware.startswith("6")]
        if name in FIRMWARE_7:
            return FIRMWARE_7[name] if version.startswith("7") else None
        return {
            "deviceid": str(first.device_id if self.settings.layout == "chain" else 99010),
            "system.serial": str(first.serial_number if self.settings.layout == "chain" else 110),
            "version": version,
            "version.build": build,
            "system.axiscount": str(len(self.axes)),
            "comm.alert": str(int(self.alerts_on)),
            "system.access": "1",
        }.get(name)

    def _axis_setting(self, name: str, axis: AxisState, now: float) -> int | None:
        if name in ("peripheralid", "peripheral.serial") and self.settings.layout == "mcc":
            return axis.model.device_id if name == "peripheralid" else axis.model.serial_number
        values: dict[str, int] = {
            "pos": axis.count(now),
            "limit.min": 0,
            "limit.max": axis.limit_max,
            "limit.home.pos": 0,
            "limit.away.pos": axis.limit_max,
            "resolution": 64,
            **axis.settings,
        }
        return values.get(name)

    def _set(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if len(command.words) != 3 or command.words[1] not in WRITABLE:
            return BAD_COMMAND
        name, value = command.words[1], _whole(command.words[2])
        if value is None or value < 0:
            return BAD_DATA
        if name == "comm.alert":
            self.alerts_on = bool(value)
            return Answer()
        for axis in axes:
            ceiling = axis.model.max_speed / axis.model.microstep * 1.6384
            if name == "maxspeed" and not 1 <= value <= 2 * ceiling:
                return BAD_DATA
            axis.settings[name] = value
        return Answer()

    def _home(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if any(not axis.driver_on for axis in axes):
            return DRIVER_DISABLED
        for axis in axes:
            axis.home(now)
        return Answer()

    def _move(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if any(not axis.driver_on for axis in axes):
            return DRIVER_DISABLED
        if len(command.words) < 2:
            return BAD_COMMAND
        kind, numbers = command.words[1], [_whole(word) for word in command.words[2:]]
        if any(number is None for number in numbers):
            return BAD_DATA
        if len(numbers) > 1 and self.settings.firmware.startswith("6"):
            return BAD_DATA
        return self._begin_moves(kind, [n for n in numbers if n is not None], axes, now)

    def _begin_moves(self, kind: str, numbers: list[int], axes: list[AxisState], now: float) -> Answer:
        targets: list[tuple[AxisState, float, float | None]] = []
        for axis in axes:
            planned = _target(kind, numbers, axis, now)
            if planned is None:
                return BAD_COMMAND
            target, speed = planned
            unreferenced = kind == "abs" and not axis.homed and self.settings.guessed.refuse_move_before_home
            if unreferenced or not 0 <= target <= axis.limit_max:
                return BAD_DATA
            targets.append((axis, target, speed))
        acceleration = numbers[2] if len(numbers) > 2 else None
        for axis, target, speed in targets:
            axis.go(target, now, speed=speed, acceleration=acceleration)
        return Answer()

    def _stop(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        self.pvt.disable(now)
        for axis in axes:
            axis.stop(now)
        return Answer()

    def _estop(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        self.pvt.disable(now)
        for axis in axes:
            axis.halt(now)
        return Answer()

    def _warnings(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if command.words[1:] == ("clear",):
            return Answer(axes[0].clear_flags() if len(axes) == 1 else _cleared(axes))
        return Answer(axes[0].all_flags())

    def _driver(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        if command.words[1:] not in (("enable",), ("disable",)):
            return BAD_COMMAND
        for axis in axes:
            axis.driver_on = command.words[1] == "enable"
            if not axis.driver_on:
                axis.halt(now)
        return Answer()

    def _io(self, command: Command, axes: list[AxisState], now: float) -> Answer:
        return Answer("0 0 0 0") if command.words[1:] == ("info",) else BAD_COMMAND


def _whole(word: str) -> int | None:
    try:
        return int(word)
    except ValueError:
        return None


def _cleared(axes: list[AxisState]) -> str:
    for axis in axes:
        axis.clear_flags()
    return "00"


def _target(kind: str, numbers: list[int], axis: AxisState, now: float) -> tuple[float, float | None] | None:
    """Return (target count, speed in microsteps/s or None) of a move command, or None when it is malformed."""
    speed = numbers[1] / 1.6384 if len(numbers) > 1 else None
    if kind == "vel" and numbers:
        velocity = numbers[0] / 1.6384
        here = axis.count(now)
        return (here if velocity == 0 else float(axis.limit_max if velocity > 0 else 0)), abs(velocity) or None
    if kind in ("min", "max"):
        return (0.0 if kind == "min" else float(axis.limit_max)), None
    if kind == "abs" and numbers:
        return float(numbers[0]), speed
    if kind == "rel" and numbers:
        return float(axis.count(now) + numbers[0]), speed
    return None
