"""The page's requests: the page itself, questions, commands, uploads, files by ticket."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import IO, Any

import tornado.web

from eddyscan.core.errors import EddyscanError
from eddyscan.web import uploads
from eddyscan.web.access import OPERATOR
from eddyscan.web.asking import Refused
from eddyscan.web.door import Door
from eddyscan.web.pages import login_page, main_page, refused_page

STATIC = Path(__file__).parent / "static"
KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
READING = ("list", "overview", "scene", "view", "form", "check")
WRITING = ("save", "make", "duplicate", "decide")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; worker-src blob:; connect-src 'none'; "
    "form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)


class Guarded(tornado.web.RequestHandler):
    """Checks host, origin and token before anything else happens."""

    role: str | None = None
    needs_token = True

    def initialize(self, door: Door) -> None:
        self.door = door

    def set_default_headers(self) -> None:
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def prepare(self) -> None:
        fault = foreign(self.door, self.request)
        if fault:
            self.refuse(403, fault)
            return
        self.role = self.door.access.role_of(self.token(), self.request.remote_ip or "")
        if self.needs_token and self.role is None:
            self.refuse(401, "the token is missing or wrong. Open the address that eddyscan serve printed.")

    def token(self) -> str | None:
        """Return the token of this request: the Authorization header, never a cookie."""
        kind, _, token = self.request.headers.get("Authorization", "").partition(" ")
        return token if kind == "Bearer" else None

    def refuse(self, status: int, message: str) -> None:
        """End with an error in words."""
        self.set_status(status)
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.finish(json.dumps({"error": message}))

    def need_operator(self) -> bool:
        """Tell whether this request may change things; refuse it otherwise."""
        if self.role == OPERATOR:
            return True
        self.refuse(403, "this link is read-only. Ask for the operator's address.")
        return False

    def body(self) -> dict[str, Any]:
        """Return the JSON object of the request; raises Refused when it is none."""
        try:
            value = json.loads(self.request.body)
        except (ValueError, RecursionError):
            raise Refused("the request is no valid JSON. Reload the page.") from None
        if not isinstance(value, dict):
            raise Refused("the request is no JSON object. Reload the page.")
        return value

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        error = kwargs.get("exc_info", (None, None, None))[1]
        if isinstance(error, Refused):
            self.refuse(error.status, str(error))
        elif isinstance(error, EddyscanError):
            self.refuse(400 if error.exit_code == 2 else 409, str(error))
        elif status_code == 405:
            self.refuse(405, f"{self.request.method} is not answered here.")
        else:
            self.refuse(status_code, "the page's program met a fault nobody foresaw; the terminal shows it.")

    def log_exception(self, typ: Any, value: Any, tb: Any) -> None:
        if not isinstance(value, (Refused, EddyscanError, tornado.web.HTTPError)):
            super().log_exception(typ, value, tb)


def foreign(door: Door, request: Any) -> str | None:
    """Return why a request does not come from our own page, or None."""
    host, origin = request.headers.get("Host"), request.headers.get("Origin")
    if not door.access.host_allowed(host):
        return f"this page does not answer to the name {str(host)[:80]!r}. Use the printed address."
    if not door.access.origin_allowed(origin, host):
        return f"requests from {str(origin)[:80]!r} are refused."
    return None


class Page(Guarded):
    """The page, with the token in its address."""

    def token(self) -> str | None:
        return self.get_query_argument("token", None)

    def refuse(self, status: int, message: str) -> None:
        self.set_status(status)
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish(login_page() if status == 401 and self.door.access.asks_password else refused_page(message))

    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish(
            main_page(
                {
                    "role": self.role,
                    "start": self.door.start_with,
                    "armed": self.door.bench.rig.arm,
                    "rig": str(self.door.bench.rig.file or ""),
                    "viewer": self.door.access.address("viewer") if self.role == OPERATOR else "",
                }
            )
        )


class Login(Guarded):
    """Password in, token out."""

    needs_token = False

    def post(self) -> None:
        token = self.door.access.login(str(self.body().get("password", "")))
        if token is None:
            raise Refused("wrong password, or too many wrong ones: wait half a minute.", 401)
        self.finish({"token": token})


class Static(Guarded):
    """Scripts and styles: the same for everybody, no secret in them."""

    needs_token = False

    def get(self, name: str) -> None:
        path = STATIC / name
        if not path.is_file():
            raise Refused(f"there is no {name}.", 404)
        self.set_header("Content-Type", f"{KINDS[path.suffix]}; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")
        self.finish(path.read_bytes())


class Nowhere(Guarded):
    """Every other address."""

    needs_token = False

    def prepare(self) -> None:
        self.refuse(404, "there is nothing at this address.")


class Ask(Guarded):
    """A question for the library: JSON back, or bytes."""

    async def post(self) -> None:
        question = self.body()
        ask = question.pop("ask", None)
        if ask in WRITING:
            if not self.need_operator():
                return
            self._require_idle(ask, question)
        elif ask not in READING:
            raise Refused(f"the page asked for {str(ask)[:40]!r}, which this program does not know. Reload the page.")
        question.pop("id", None)
        value, payload = await self.door.library.ask(ask, **question)
        if ask in WRITING:
            self.door.bench.revision += 1
            self.door.news()
        self.set_header("Content-Type", "application/octet-stream" if payload else "application/json; charset=utf-8")
        self.finish(payload or json.dumps(value))

    def _require_idle(self, ask: str, question: dict[str, Any]) -> None:
        job = self.door.bench.job
        name = question.get("name")
        if ask == "save" and job is not None and job.active and Path(job.folder).name == name:
            raise Refused(
                f"{job.told()['title']} of {name} is under way, and its technique must not change meanwhile. "
                "Wait for it, or press Stop.",
                409,
            )


class Do(Guarded):
    """A command for the bench, and tickets for files."""

    async def post(self) -> None:
        command = self.body()
        do = command.get("do")
        if do == "stop":
            self.door.bench.stop(self.role or "viewer")
            self.finish({})
        elif do == "report":
            value, _ = await self.door.library.ask("report_file", name=command.get("name"))
            self.finish({"address": f"/file/{self.door.ticket(Path(value['file']))}"})
        elif self.need_operator():
            self.finish(await self._operate(do, command))

    async def _operate(self, do: Any, command: dict[str, Any]) -> dict[str, Any]:
        bench = self.door.bench
        if do == "run":
            value, _ = await self.door.library.ask("folder", name=command.get("name"))
            steps = command.get("steps")
            if not isinstance(steps, list):
                raise Refused("no step is named. Reload the page.")
            return {"job": await bench.run(Path(value["folder"]), [str(step) for step in steps])}
        if do == "pause":
            bench.pause()
        elif do == "resume":
            bench.resume()
        else:
            raise Refused(f"there is no command {str(do)[:40]!r}. Reload the page.")
        return {}


@tornado.web.stream_request_body
class Upload(Guarded):
    """A file for 1-views, written to the disk as it comes, then checked by the library."""

    _file: IO[bytes] | None = None
    _path: Path | None = None
    _received = 0

    def prepare(self) -> None:
        super().prepare()
        if self._finished or not self.need_operator():
            return
        length = self.request.headers.get("Content-Length")
        size = int(length) if length and length.isdigit() else None
        fault = uploads.refusal(size, uploads.free_bytes(self.door.root))
        if fault:
            self.refuse(411 if size is None else 413, fault)
            self.set_header("Connection", "close")
            return
        self.request.connection.set_max_body_size(uploads.MAX_BYTES)  # type: ignore[union-attr]
        handle, name = tempfile.mkstemp(prefix=".upload-", dir=self.door.root)
        self._file, self._path = os.fdopen(handle, "wb"), Path(name)

    def data_received(self, chunk: bytes) -> None:
        if self._file is not None:
            self._received += len(chunk)
            self._file.write(chunk)

    async def put(self) -> None:
        if self._file is None or self._path is None:
            return
        self._file.close()
        name, given = self.get_query_argument("name", ""), self.get_query_argument("file", "")
        job = self.door.bench.job
        if job is not None and job.active and Path(job.folder).name == name:
            raise Refused(f"{job.told()['title']} of {name} is under way. Wait for it, then add views.", 409)
        value, _ = await self.door.library.ask("take_upload", name=name, given=given, temporary=str(self._path))
        self.door.bench.revision += 1
        self.door.news()
        self.finish(value)

    def on_finish(self) -> None:
        self._clean()

    def on_connection_close(self) -> None:
        super().on_connection_close()
        self._clean()

    def _clean(self) -> None:
        if self._file is not None:
            self._file.close()
        if self._path is not None:
            self._path.unlink(missing_ok=True)


class Ticket(Guarded):
    """A file behind a random address: the report, in a sandbox of its own."""

    needs_token = False

    def get(self, word: str) -> None:
        path = self.door.tickets.get(word)
        if path is None or not path.is_file():
            raise Refused("this address does not open anything any more. Press the button on the page again.", 404)
        self.set_header("Content-Security-Policy", REPORT_POLICY)
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish(path.read_bytes())
