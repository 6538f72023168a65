"""The door's side of the library: questions out, answers in, in any order."""

from __future__ import annotations

import asyncio
import itertools
import json
from pathlib import Path
from typing import Any

from eddyscan.web.child import Child

ANSWER_WITHIN_S = 60.0


class Refused(Exception):
    """An answer that is an error: words for the page and an HTTP status."""

    def __init__(self, message: str, status: int = 400) -> None:
        super().__init__(message)
        self.status = status


class Asking:
    """Asks the library process; a question costs the door nothing while it waits."""

    def __init__(self, root: Path) -> None:
        self._child = Child("eddyscan.web.library", [json.dumps(str(root))], on_message=self._take, on_exit=self._died)
        self._numbers = itertools.count(1)
        self._open: dict[int, asyncio.Future[tuple[Any, bytes]]] = {}

    @property
    def pid(self) -> int | None:
        """Return the library's process id while it runs."""
        return self._child.pid

    async def start(self) -> None:
        """Start the process."""
        await self._child.start()

    async def close(self) -> None:
        """End the process."""
        await self._child.close()

    async def ask(self, ask: str, **question: Any) -> tuple[Any, bytes]:
        """Return the library's value and payload; raises Refused with its words otherwise."""
        await self._child.start()
        number = next(self._numbers)
        future: asyncio.Future[tuple[Any, bytes]] = asyncio.get_running_loop().create_future()
        self._open[number] = future
        self._child.send({**question, "id": number, "ask": ask})
        try:
            return await asyncio.wait_for(future, ANSWER_WITHIN_S)
        except TimeoutError:
            raise Refused(f"{ask} had no answer within {ANSWER_WITHIN_S:.0f} s. Try again.", 504) from None
        finally:
            self._open.pop(number, None)

    def _take(self, message: dict[str, Any], payload: bytes) -> None:
        future = self._open.get(message["id"])
        if future is None or future.done():
            return
        if "error" in message:
            future.set_exception(Refused(message["error"], message["status"]))
        else:
            future.set_result((message["value"], payload))

    def _died(self, code: int) -> None:
        for future in self._open.values():
            if not future.done():
                words = (
                    f"the reading process ended (code {code}) over this question. Try again; the scan is not touched."
                )
                future.set_exception(Refused(words, 500))
