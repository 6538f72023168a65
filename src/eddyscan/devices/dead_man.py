"""A small second process that stops the axes when this one dies without a word.

A killed program cannot say stop. Its dead man can: it holds the other end of a
pipe, and when that closes without a farewell it opens the device anew and sends
one line. It needs nothing but the standard library, so it is there in 20 ms.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys

FAREWELL = b"bye"
WATCH = """
import os, socket, sys
if sys.stdin.buffer.read() != b"bye":
    line = bytes.fromhex(sys.argv[1])
    if len(sys.argv) == 4:
        with socket.create_connection((sys.argv[2], int(sys.argv[3])), timeout=5) as link:
            link.sendall(line)
            link.shutdown(socket.SHUT_WR)
            link.settimeout(1.0)
            link.recv(64)
    else:
        port = os.open(sys.argv[2], os.O_WRONLY | os.O_NOCTTY)
        os.write(port, line)
"""


class DeadMan:
    """Sends `line` to the device at `address` when this process ends without `dismiss`.

    Parameters
    ----------
    address : (host, port) of a TCP device, or the path of a serial port, whose
        line settings outlive the program that made them
    line : what stops the device
    """

    def __init__(self, address: tuple[str, int] | str, line: bytes) -> None:
        where = [address] if isinstance(address, str) else [address[0], str(address[1])]
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", WATCH, line.hex(), *where],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # a Ctrl-C or a closed terminal is not for the dead man
        )

    def dismiss(self) -> None:
        """Say that all is well and let the second process end; more than once is fine."""
        stdin = self._process.stdin
        if stdin is None or stdin.closed:
            return
        with contextlib.suppress(OSError):
            stdin.write(FAREWELL)
            stdin.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
