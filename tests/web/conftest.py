from __future__ import annotations

import asyncio
import shutil
import threading
import time
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

    def begin_afresh(self) -> None:
        bench, until = self.door.bench, time.monotonic() + 20
        while bench.job is not None and bench.job.active and time.monotonic() < until:
            self.visitor().do("stop")
            time.sleep(0.05)

        async def forget() -> None:
            bench.job, bench.readings, bench.scan_number, bench.scan_begins_anew = None, [], 0, False
            bench.log.clear()

        self.do(forget())
        for folder in self.door.root.iterdir():
            shutil.rmtree(folder)

    def close(self) -> None:
        self.do(self.running.close())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5)
        self._loop.close()


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A planned inspection to copy: planning it anew for every test takes longer."""
    return planned_inspection(tmp_path_factory.mktemp("model") / "plate-1").folder


@pytest.fixture(scope="module")
def kept_door(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """The door of one test file: its helper processes are started once."""
    served = Served(tmp_path_factory.mktemp("door") / "shelf")
    yield served
    served.close()


@pytest.fixture
def inspection(request: pytest.FixtureRequest, model: Path, tmp_path: Path) -> Inspection:
    """Give a fresh plate-1, on the shelf of the file's door when the test uses that one."""
    if "served" in request.fixturenames:
        return Inspection(request.getfixturevalue("served").door.root / "plate-1")
    shutil.copytree(model, tmp_path / "shelf" / "plate-1")
    return Inspection(tmp_path / "shelf" / "plate-1")


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
def served(kept_door: Served, model: Path) -> Iterator[Served]:
    """Give the file's door with plate-1 alone on the shelf and an idle bench."""
    kept_door.begin_afresh()
    shutil.copytree(model, kept_door.door.root / "plate-1")
    yield kept_door
    kept_door.begin_afresh()
