"""A helper process of the page's door, spoken to without ever waiting for it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from eddyscan.web.link import framed

MAX_LINE_BYTES = 1 << 26
PATIENCE_S = 5.0

OnMessage = Callable[[dict[str, Any], bytes], None]


class Child:
    """Runs ``python -m MODULE`` at the other end of a socket; starts it again after it died.

    The heavy libraries live in these processes: loading one holds Python's
    interpreter lock for longer than a Stop may take.

    Parameters
    ----------
    module, arguments : what to run; the socket's number is put before the arguments
    on_message : called in the event loop with every message and its payload
    on_exit : called with the exit code when the process ended by itself
    """

    def __init__(
        self, module: str, arguments: Sequence[str], *, on_message: OnMessage, on_exit: Callable[[int], None]
    ) -> None:
        self._command = (sys.executable, "-m", module)
        self._arguments = tuple(arguments)
        self._on_message = on_message
        self._on_exit = on_exit
        self._process: subprocess.Popen[bytes] | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._listener: asyncio.Task[None] | None = None
        self._closing = False

    @property
    def pid(self) -> int | None:
        """Return the process id while it runs."""
        return None if self._process is None or self._process.poll() is not None else self._process.pid

    async def start(self) -> None:
        """Start the process unless it runs."""
        if self.pid is not None and self._writer is not None and not self._writer.is_closing():
            return
        here, there = socket.socketpair()
        command = (*self._command, str(there.fileno()), *self._arguments)
        self._process = subprocess.Popen(
            command, pass_fds=[there.fileno()], stdin=subprocess.DEVNULL, start_new_session=True, env=environment()
        )
        there.close()
        here.setblocking(False)
        reader, self._writer = await asyncio.open_connection(sock=here, limit=MAX_LINE_BYTES)
        self._listener = asyncio.ensure_future(self._listen(reader, self._process))

    def send(self, message: Mapping[str, Any]) -> bool:
        """Send without waiting; tell whether there was anybody to send to."""
        if self._writer is None or self._writer.is_closing():
            return False
        self._writer.write(framed(message))
        return True

    async def _listen(self, reader: asyncio.StreamReader, process: subprocess.Popen[bytes]) -> None:
        with contextlib.suppress(asyncio.IncompleteReadError, ConnectionError):
            while line := await reader.readline():
                message = json.loads(line)
                size = message.get("bytes", 0)
                self._on_message(message, await reader.readexactly(size) if size else b"")
        code = await asyncio.to_thread(_ended, process)
        if self._writer is not None:
            self._writer.close()
        if not self._closing:
            self._on_exit(code)

    async def close(self) -> None:
        """Close the wire, which tells the helper to stop the axes and end; wait for it."""
        self._closing = True
        if self._writer is not None:
            self._writer.close()
        if self._listener is not None:
            await self._listener

    def kill(self) -> None:
        """End a process that does not answer."""
        if self._process is not None:
            self._process.kill()


def environment() -> dict[str, str]:
    """Return the helper's environment: ours, and modules found where we found them."""
    places = [place for place in sys.path if place]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places), "PYTHONUNBUFFERED": "1"}


def _ended(process: subprocess.Popen[bytes]) -> int:
    try:
        return process.wait(PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()
