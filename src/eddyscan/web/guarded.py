"""What every request goes through first: host, origin, token, and errors in words."""

from __future__ import annotations

import json
from typing import Any

import tornado.web

from eddyscan.core.errors import EddyscanError
from eddyscan.web.access import OPERATOR
from eddyscan.web.asking import Refused
from eddyscan.web.door import Door

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
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
