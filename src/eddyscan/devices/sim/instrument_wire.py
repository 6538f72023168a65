"""A simulated instrument on the loopback: one line in, one answer out."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable

from eddyscan.core.errors import DeviceError

Answer = Callable[[str], "str | None"]


class LinkLost(Exception):
    """The simulated instrument drops its link now."""


class InstrumentServer:
    """Serves SCPI-like lines on TCP, as a LAN instrument's raw socket does.

    Parameters
    ----------
    answer : callable
        Takes one command without its line end; returns the answer, or None when
        the command has none. Called under a lock: one command at a time.
    """

    def __init__(self, answer: Answer, host: str = "127.0.0.1") -> None:
        self._answer, self._host = answer, host
        self._lock = threading.Lock()
        self._peers: list[socket.socket] = []
        self._server: socket.socket | None = None
        self._closing = threading.Event()

    def start(self, port: int = 0) -> tuple[str, int]:
        """Listen on `port` (0: any free one); return (host, port)."""
        try:
            self._server = socket.create_server((self._host, port))
        except OSError as fault:
            raise DeviceError(
                f"the simulated instrument cannot listen on {self._host}:{port}: {fault}. Give another port."
            ) from fault
        threading.Thread(target=self._accept, name="instrument-simulator", daemon=True).start()
        host, bound = self._server.getsockname()[:2]
        return str(host), int(bound)

    def close(self) -> None:
        """Stop listening and drop every connection."""
        self._closing.set()
        if self._server is not None:
            self._server.close()
        self.drop_links()

    def drop_links(self) -> None:
        """Cut every connection, as a pulled cable does."""
        for peer in list(self._peers):
            with contextlib.suppress(OSError):
                peer.shutdown(socket.SHUT_RDWR)
            with contextlib.suppress(OSError):
                peer.close()
        self._peers.clear()

    def _accept(self) -> None:
        server = self._server
        while server is not None and not self._closing.is_set():
            try:
                peer, _ = server.accept()
            except OSError:
                return
            peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peers.append(peer)
            threading.Thread(target=self._serve, args=(peer,), name="instrument-link", daemon=True).start()

    def _serve(self, peer: socket.socket) -> None:
        with contextlib.suppress(OSError, ValueError), peer, peer.makefile("rb") as lines:
            for line in lines:
                if not self._respond(peer, line.decode("ascii", "replace").strip()):
                    break
        if peer in self._peers:
            self._peers.remove(peer)

    def _respond(self, peer: socket.socket, command: str) -> bool:
        try:
            with self._lock:
                answer = self._answer(command)
        except LinkLost:
            return False
        if answer is not None:
            peer.sendall(answer.encode("ascii") + b"\n")
        return True
