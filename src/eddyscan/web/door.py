"""The door: one event loop that lets pages in, passes questions on and sends news ten times a second.

It imports no heavy library and computes nothing, so a Stop passes through it at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web

from eddyscan.core.errors import InputError
from eddyscan.web.access import Access
from eddyscan.web.asking import Asking
from eddyscan.web.bench import Bench, RigChoice
from eddyscan.web.priority import first_in_line

MAX_HEADER_BYTES = 16 << 10
MAX_BODY_BYTES = 1 << 20
IDLE_S = 600.0
MAX_PAGES = 24
MAX_TICKETS = 200


@dataclass
class Door:
    """What every request handler needs."""

    access: Access
    bench: Bench
    library: Asking
    root: Path
    start_with: str | None = None
    pages: set[Any] = field(default_factory=set)
    tickets: dict[str, Path] = field(default_factory=dict)
    edited: int = 0

    def ticket(self, file: Path) -> str:
        """Return a random word that opens this one file, and nothing else, without a token."""
        for word, kept in self.tickets.items():
            if kept == file:
                return word
        while len(self.tickets) >= MAX_TICKETS:
            del self.tickets[next(iter(self.tickets))]
        word = secrets.token_urlsafe(18)
        self.tickets[word] = file
        return word

    def news(self) -> None:
        """Wake every page."""
        for page in self.pages:
            page.wake()


def application(door: Door) -> tornado.web.Application:
    """Return the handlers with their addresses."""
    from eddyscan.web import live, receiving, requests

    given = {"door": door}
    routes: list[Any] = [
        (r"/", requests.Page, given),
        (r"/login", requests.Login, given),
        (r"/static/([a-z0-9_-]+\.(?:js|css|svg))", requests.Static, given),
        (r"/api/ask", requests.Ask, given),
        (r"/api/do", requests.Do, given),
        (r"/api/upload", receiving.Upload, given),
        (r"/file/([A-Za-z0-9_-]+)", requests.Ticket, given),
        (r"/live", live.Live, given),
    ]
    return tornado.web.Application(
        routes,
        default_handler_class=requests.Nowhere,
        default_handler_args=given,
        log_function=lambda _: None,
        websocket_ping_interval=20,
        websocket_max_message_size=1 << 16,
    )


@dataclass
class Running:
    """A page that is being served: its addresses and how to end it."""

    door: Door
    server: tornado.httpserver.HTTPServer

    @property
    def address(self) -> str:
        """Return the operator's address."""
        return self.door.access.address()

    async def close(self) -> None:
        """Stop the axes, send the pages away, end the helper processes."""
        self.server.stop()
        for page in list(self.door.pages):
            page.close(1001, "the program ended")
        await self.door.bench.close()
        await self.door.library.close()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self.server.close_all_connections(), 2.0)


async def open_door(
    folder: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    password: str | None = None,
    rig: RigChoice | None = None,
    line: str | None = None,
) -> Running:
    """Start serving and return at once; port 0 takes a free one."""
    root, start_with = shelf_of(folder)
    sockets = bound(host, port)
    access = Access(host, sockets[0].getsockname()[1], password)
    library = Asking(root)
    holder: list[Door] = []
    options = {} if line is None else {"line": line}
    bench = Bench(rig, on_change=lambda: holder[0].news() if holder else None, **options)
    door = Door(access, bench, library, root, start_with)
    holder.append(door)
    server = tornado.httpserver.HTTPServer(
        application(door),
        max_header_size=MAX_HEADER_BYTES,
        max_body_size=MAX_BODY_BYTES,
        idle_connection_timeout=IDLE_S,
        body_timeout=IDLE_S,
    )
    first_in_line()
    await library.start()
    await bench.start()
    server.add_sockets(sockets)
    return Running(door, server)


def bound(host: str, port: int) -> list[Any]:
    """Return listening sockets, or raise InputError when the port cannot be had."""
    try:
        return tornado.netutil.bind_sockets(port, address=host)
    except (OSError, OverflowError) as error:
        raise InputError(
            f"cannot listen on {host} port {port}: {error}. Another eddyscan serve may be running; "
            "name another port with --port, or --port 0 for any free one."
        ) from None


def shelf_of(folder: Path) -> tuple[Path, str | None]:
    """Return the folder of inspections, and the inspection to open first if `folder` is one."""
    folder = folder.absolute()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name an inspection folder or a folder of them.")
    if (folder / "technique.toml").is_file():
        return folder.parent, folder.name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot make the folder {folder}: {error.strerror}. Name one that you may write to."
        ) from None
    return folder, None
