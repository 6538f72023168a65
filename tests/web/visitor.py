"""A page's requests without a browser: exactly what a script or an attacker would send."""

from __future__ import annotations

import http.client
import json
import time
from typing import Any

from websockets.sync.client import ClientConnection, connect


class Visitor:
    """Speaks to the door with one token."""

    def __init__(self, port: int, token: str | None) -> None:
        self.port = port
        self.token = token

    def request(
        self, method: str, path: str, body: bytes | str | None = None, headers: dict[str, str] | None = None
    ) -> tuple[int, dict[str, str], bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        given = {"Authorization": f"Bearer {self.token}"} if self.token else {}
        try:
            connection.request(method, path, body, {**given, **(headers or {})})
            response = connection.getresponse()
            return response.status, dict(response.getheaders()), response.read()
        finally:
            connection.close()

    def post(self, path: str, value: Any, **headers: str) -> tuple[int, Any]:
        body = value if isinstance(value, (str, bytes)) else json.dumps(value)
        status, head, data = self.request("POST", path, body, headers)
        is_json = "json" in head.get("Content-Type", "")
        return status, json.loads(data) if is_json else data

    def ask(self, ask: str, **question: Any) -> tuple[int, Any]:
        return self.post("/api/ask", {**question, "ask": ask})

    def do(self, do: str, **command: Any) -> tuple[int, Any]:
        return self.post("/api/do", {**command, "do": do})

    def run(self, name: str, *steps: str) -> tuple[int, Any]:
        return self.do("run", name=name, steps=list(steps))

    def live(self, **options: Any) -> ClientConnection:
        return connect(
            f"ws://127.0.0.1:{self.port}/live",
            subprotocols=["eddyscan", self.token or "none"],
            compression=None,
            **options,
        )


def news_until(wire: ClientConnection, good: Any, seconds: float = 20.0) -> list[dict[str, Any]]:
    """Return the news up to the first that is `good`; fail after `seconds`."""
    seen: list[dict[str, Any]] = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        news = json.loads(wire.recv(timeout=seconds))
        seen.append(news)
        if "answer" not in news and good(news):
            return seen
    raise AssertionError(f"not within {seconds} s; last was {seen[-1] if seen else None}")


def job_state(*states: str) -> Any:
    """Return a check for news whose job is in one of the states."""
    return lambda news: news["job"] is not None and news["job"]["state"] in states
