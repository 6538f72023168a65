"""The wire between the page's door and its two helper processes: one JSON line, then raw bytes if it names any."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator, Mapping
from typing import Any

from eddyscan.core.plain import plain


def framed(message: Mapping[str, Any], payload: bytes = b"") -> bytes:
    """Return one message as bytes; NaN and infinity become null."""
    head = {**message, "bytes": len(payload)} if payload else dict(message)
    return json.dumps(plain(head), allow_nan=False, default=str).encode() + b"\n" + payload


class Link:
    """The helper's end of the wire: blocking, sends from any thread."""

    def __init__(self, wire: socket.socket) -> None:
        self._wire = wire
        self._file = wire.makefile("rb")
        self._lock = threading.Lock()

    @classmethod
    def of_descriptor(cls, descriptor: int) -> Link:
        """Take over the socket that the door left open under this number."""
        return cls(socket.socket(fileno=descriptor))

    def send(self, message: Mapping[str, Any], payload: bytes = b"") -> None:
        """Send one message; raises OSError once the door is gone."""
        data = framed(message, payload)
        with self._lock:
            self._wire.sendall(data)

    def messages(self) -> Iterator[dict[str, Any]]:
        """Yield messages until the door closes or dies."""
        try:
            for line in self._file:
                yield json.loads(line)
        except (OSError, ValueError):
            return

    def close(self) -> None:
        """Close the wire."""
        self._wire.close()
