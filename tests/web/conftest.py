from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from eddyscan.inspection import Inspection
from eddyscan.web.door import Running, open_door
from tests.web.shelf_on_disk import planned_inspection
from tests.web.visitor import Visitor

LINE = "tests.web.line_under_test"


class Served:
    """A door that serves in a thread of its own."""

    def __init__(self, root: Path, **options: Any) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.running: Running = self.do(open_door(root, **{"line": LINE, **options}))
        self.door = self.running.door

    def do(self, coroutine: Any) -> Any:
        future: Future[Any] = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        return future.result(30)

    def visitor(self, role: str = "operator") -> Visitor:
        access = self.door.access
        return Visitor(access.port, access.operator_token if role == "operator" else access.viewer_token)

    def close(self) -> None:
        self.do(self.running.close())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)
        self._loop.close()


@pytest.fixture
def inspection(tmp_path: Path) -> Inspection:
    return planned_inspection(tmp_path / "shelf" / "plate-1")


@pytest.fixture
def serve() -> Iterator[Callable[..., Served]]:
    opened: list[Served] = []

    def start(root: Path, **options: Any) -> Served:
        opened.append(Served(root, **options))
        return opened[-1]

    yield start
    for served in opened:
        served.close()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One door for the tests that leave nothing behind."""
    inspection = planned_inspection(tmp_path_factory.mktemp("shared") / "shelf" / "plate-1")
    served = Served(inspection.folder.parent)
    yield served
    served.close()


@pytest.fixture
def served(inspection: Inspection, serve: Callable[..., Served]) -> Served:
    return serve(inspection.folder.parent)
