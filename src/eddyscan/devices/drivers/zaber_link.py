"""The one place that calls zaber-motion: commands in, answers out, its exceptions in our words."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from eddyscan.core.errors import DeviceError, LinkError, MotionError
from eddyscan.devices.drivers.zaber_settings import ZaberStageSettings

LINK_FAULTS = (
    "ConnectionFailedException",
    "ConnectionClosedException",
    "RequestTimeoutException",
    "InvalidPacketException",
    "InvalidResponseException",
    "InvalidDataException",
    "IoPortErrorException",
    "SerialPortBusyException",
    "TransportAlreadyUsedException",
)
RETRY = "RequestTimeoutException"


@dataclass(frozen=True)
class Told:
    """One answer: its data, whether the axis moves, and its most urgent warning flag."""

    data: str
    busy: bool
    warning: str


class ZaberLink:
    """A connection that maps every fault to an eddyscan error and can be opened again."""

    def __init__(self, settings: ZaberStageSettings) -> None:
        self._settings = settings
        self._lock = threading.Lock()
        self._axes: dict[tuple[int, int], Any] = {}
        self._suspect = False
        self._connection = self._open()

    def tell(self, device: int, axis: int, command: str, *, retries: int = 0) -> Told:
        """Send `command` to an axis (0: the whole device) and return the answer."""
        for attempt in range(retries + 1):
            try:
                said = self._axis(device, axis).generic_command(command)
                return Told(said.data, said.status == "BUSY", said.warning_flag)
            except Exception as fault:
                if attempt == retries or type(fault).__name__ != RETRY:
                    raise self._in_our_words(fault, device, command) from fault
        raise AssertionError

    def act(self, device: int, axis: int, what: str, action: Callable[[Any], None]) -> None:
        """Run a library call on an axis object."""
        try:
            action(self._axis(device, axis))
        except Exception as fault:
            raise self._in_our_words(fault, device, what) from fault

    def broadcast(self, command: str) -> None:
        """Send `command` to every device and wait for nobody; opens the line again when it is gone."""
        self._trust()
        try:
            self._connection.generic_command_no_response(command)
        except Exception:
            self._suspect = True
            self._trust()
            self._connection.generic_command_no_response(command)

    def _trust(self) -> None:
        """Open the line again when its last command failed: a cut line swallows what is written to it."""
        with self._lock:
            if self._suspect:
                self.close()
                self._axes.clear()
                self._connection = self._open()
                self._suspect = False

    def device_of(self, number: int) -> Any:
        """Return the library's object of a device, for calls that only devices have."""
        return self._axis(number, 0)

    def call(self, number: int, what: str, action: Callable[[], Any]) -> None:
        """Run a library call for device `number`, its faults in our words."""
        try:
            action()
        except Exception as fault:
            raise self._in_our_words(fault, number, what) from fault

    def close(self) -> None:
        """Close the line; more than once is fine."""
        with contextlib.suppress(Exception):
            self._connection.close()

    def _axis(self, device: int, axis: int) -> Any:
        self._trust()
        key = (device, axis)
        if key not in self._axes:
            owner = self._connection.get_device(device)
            self._axes[key] = owner.get_axis(axis) if axis else owner
        return self._axes[key]

    def _open(self) -> Any:
        from zaber_motion.ascii import Connection

        s = self._settings
        try:
            if s.host is not None:
                connection = Connection.open_tcp(s.host, s.port)
            else:
                connection = Connection.open_serial_port(str(s.serial_port), s.baud_rate)
            connection.default_request_timeout = max(round(1000 * s.request_timeout_s), 1)
        except Exception as fault:
            raise LinkError(
                f"the Zaber stage at {s.address} does not answer: {fault}. "
                "Check power, cable and address, and that no other program holds the port."
            ) from fault
        return connection

    def _in_our_words(self, fault: Exception, device: int, command: str) -> DeviceError:
        kind, where = type(fault).__name__, f"Zaber device {device} at {self._settings.address}"
        if kind in LINK_FAULTS:
            self._suspect = True
            return LinkError(
                f"{where} gave no usable answer to {command!r} within {self._settings.request_timeout_s:g} s: {fault} "
                "Check power and cable, then run again; everything recorded so far is kept."
            )
        if kind == "DriverDisabledException":
            return MotionError(f"{where} has its driver off and refused {command!r}. Enable it, home, and run again.")
        return MotionError(f"{where} refused {command!r}: {fault} Home the stage, then run again.")
