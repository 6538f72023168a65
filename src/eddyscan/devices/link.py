"""Lines to and from a device: over TCP, over a serial port, recorded, or replayed from a recording."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Sequence
from typing import Any, Literal, Protocol

from eddyscan.core.errors import LinkError

Traffic = list[tuple[Literal[">", "<"], bytes]]


class Link(Protocol):
    """Bytes out from any thread, lines in for one reader."""

    def write(self, data: bytes) -> None:
        """Send bytes at once, or raise LinkError."""

    def read_line(self, timeout_s: float) -> bytes:
        """Return the next line without its end, or raise LinkError after `timeout_s` of wall time."""

    def close(self) -> None:
        """Close; more than once is fine."""


class TcpLink:
    """A device behind host and port; raises LinkError when nobody listens."""

    def __init__(self, host: str, port: int, *, connect_timeout_s: float = 3.0) -> None:
        self.where = f"{host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout=connect_timeout_s)
        except OSError as fault:
            raise LinkError(
                f"nobody answers at {self.where}: {fault}. Check power, cable and address in rig.toml."
            ) from fault
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._held = b""
        self._writing = threading.Lock()

    def write(self, data: bytes) -> None:
        """Send bytes at once."""
        try:
            with self._writing:
                self._socket.sendall(data)
        except OSError as fault:
            raise LinkError(f"the link to {self.where} is gone: {fault}. Check the cable, then run again.") from fault

    def read_line(self, timeout_s: float) -> bytes:
        """Return the next line."""
        while b"\n" not in self._held:
            try:
                self._socket.settimeout(timeout_s)
                more = self._socket.recv(4096)
            except TimeoutError:
                raise LinkError(
                    f"the device at {self.where} did not answer within {timeout_s:g} s. Check power and cable."
                ) from None
            except OSError as fault:
                raise LinkError(
                    f"the link to {self.where} is gone: {fault}. Check the cable, then run again."
                ) from fault
            if not more:
                raise LinkError(f"the device at {self.where} closed the link. Check power and cable, then run again.")
            self._held += more
        line, self._held = self._held.split(b"\n", 1)
        return line.rstrip(b"\r")

    def close(self) -> None:
        """Close the socket."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


class SerialLink:
    """A device behind a serial port (8N1); raises LinkError when the port cannot be opened."""

    def __init__(self, port: str, baud_rate: int) -> None:
        import serial

        self.where = f"{port} at {baud_rate} baud"
        try:
            self._serial: Any = serial.Serial(port, baud_rate, timeout=0.1, write_timeout=2.0)
        except (OSError, ValueError) as fault:
            raise LinkError(
                f"the serial port {self.where} cannot be opened: {fault}. Check the cable and the right to "
                "use the port."
            ) from fault
        self._held = b""

    def write(self, data: bytes) -> None:
        """Send bytes at once."""
        try:
            self._serial.write(data)
        except OSError as fault:
            raise LinkError(f"the link to {self.where} is gone: {fault}. Check the cable, then run again.") from fault

    def read_line(self, timeout_s: float) -> bytes:
        """Return the next line."""
        try:
            self._serial.timeout = timeout_s
            line: bytes = self._held + self._serial.read_until(b"\n")
        except OSError as fault:
            raise LinkError(f"the link to {self.where} is gone: {fault}. Check the cable, then run again.") from fault
        if not line.endswith(b"\n"):
            self._held = line
            raise LinkError(f"the device at {self.where} did not answer within {timeout_s:g} s. Check power and cable.")
        self._held = b""
        return line.rstrip(b"\r\n")

    def close(self) -> None:
        """Close the port."""
        self._serial.close()


class RecordingLink:
    """Passes everything on and keeps it: ">" sent, "<" received."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self.traffic: Traffic = []

    def write(self, data: bytes) -> None:
        """Send and keep."""
        self.traffic.append((">", data))
        self._link.write(data)

    def read_line(self, timeout_s: float) -> bytes:
        """Receive and keep."""
        line = self._link.read_line(timeout_s)
        self.traffic.append(("<", line))
        return line

    def close(self) -> None:
        """Close the link behind."""
        self._link.close()


class ReplayLink:
    """Answers from a recording, and insists that the same is sent again."""

    def __init__(self, traffic: Sequence[tuple[str, bytes]]) -> None:
        self._left = list(traffic)

    def write(self, data: bytes) -> None:
        """Compare with the recording, or raise LinkError."""
        expected = self._left.pop(0) if self._left else ("end", b"")
        if expected != (">", data):
            raise LinkError(f"the recording has {expected[1]!r} ({expected[0]}) where {data!r} was sent.")

    def read_line(self, timeout_s: float) -> bytes:
        """Return the recorded line, or raise LinkError."""
        if not self._left or self._left[0][0] != "<":
            raise LinkError(f"the recording has no answer here (waited {timeout_s:g} s).")
        return self._left.pop(0)[1]

    def close(self) -> None:
        """Nothing to close."""
