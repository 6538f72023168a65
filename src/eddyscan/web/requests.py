"""The page's requests: the page itself, questions, commands, files by ticket."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from eddyscan.web.access import OPERATOR
from eddyscan.web.asking import Refused
from eddyscan.web.guarded import Guarded
from eddyscan.web.pages import login_page, main_page, refused_page

STATIC = Path(__file__).parent / "static"
KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
READING = ("list", "overview", "scene", "view", "form", "check")
WRITING = ("save", "make", "duplicate", "decide")
REPORT_POLICY = (
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; worker-src blob:; connect-src 'none'; "
    "form-action 'none'; frame-ancestors 'none'; base-uri 'none'"
)


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
