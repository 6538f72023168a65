"""The engine on real processes: local workers, a cluster on the loopback, and what happens when parts of it die."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from eddyscan.campaign import engine
from eddyscan.campaign.engine import run_batches
from eddyscan.campaign.run import run_campaign
from eddyscan.core.errors import WorkError
from tests.campaign.conftest import written
from tests.campaign.small_cases import lethal_rows, slow_rows, square_rows

# Dask says in warnings what the tests bring about on purpose: dead workers, busy ports, slow starts.
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:.*:UserWarning:distributed"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 120.0
CASES = 20


def cases(count: int) -> list[dict[str, int]]:
    return [{"case": number} for number in range(count)]


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def started(*words: str) -> subprocess.Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, *words], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def wait_until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.05)


def answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Cluster:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self) -> None:
        port = free_port()
        self.address = f"tcp://127.0.0.1:{port}"
        self.scheduler = started(
            "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard", "--no-show"
        )
        self.workers: list[subprocess.Popen[bytes]] = []
        wait_until(lambda: answers(port))
        for _ in range(2):
            self.add_worker()

    def add_worker(self) -> None:
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--death-timeout", "20")
        self.workers.append(started("-m", "dask", "worker", self.address, *options))

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
        for process in (*self.workers, self.scheduler):
            process.wait()


@contextmanager
def cluster() -> Iterator[Cluster]:
    made = Cluster()
    try:
        yield made
    finally:
        made.close()


def collected(batches: Iterator[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    return sorted((row for rows in batches for row in rows), key=lambda row: int(row["case"]))


def without_time(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def test_one_and_two_local_workers_give_the_same_rows(small_tables: None, tmp_path: Path) -> None:
    file = written(tmp_path, cases=8)
    said: list[str] = []
    one = run_campaign(file, tmp_path / "one")
    two = run_campaign(file, tmp_path / "two", workers=2, say=said.append)
    assert without_time(two) == without_time(one)
    assert said[0].startswith("dashboard: http://")


def test_a_cluster_of_separate_processes_survives_the_loss_of_a_worker(small_tables: None, tmp_path: Path) -> None:
    file = written(tmp_path, cases=6)
    with cluster() as here:
        rows = run_campaign(file, tmp_path / "cluster", scheduler=here.address)
        assert without_time(rows) == without_time(run_campaign(file, tmp_path / "alone"))

        came: list[dict[str, Any]] = []
        for batch in run_batches(slow_rows, 0.05, cases(40), workers=2, scheduler=here.address):
            came += batch
            if len(came) <= 2:
                here.workers[0].kill()
        assert sorted(row["case"] for row in came) == list(range(40))


def test_a_lost_scheduler_is_one_message_and_rows_that_came_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(engine.DASK_SETTINGS, "distributed.comm.timeouts.connect", "2s")
    with cluster() as here:
        came: list[dict[str, Any]] = []

        def until_lost() -> None:
            for batch in run_batches(slow_rows, 0.1, cases(200), workers=2, scheduler=here.address):
                came.extend(batch)
                here.scheduler.kill()

        with pytest.raises(WorkError, match=r"the Dask scheduler was lost .*repeat the command: it goes on"):
            until_lost()
    numbers = [row["case"] for row in came]
    assert numbers
    assert len(set(numbers)) == len(numbers)


def test_a_scheduler_that_is_not_there_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "REACH_TIMEOUT_S", 1)
    address = f"tcp://127.0.0.1:{free_port()}"
    with pytest.raises(WorkError, match=rf"no usable Dask scheduler at {address}: .*Start one with `dask scheduler`"):
        list(run_batches(square_rows, 2, cases(3), scheduler=address))


def test_cases_that_kill_every_worker_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(engine.DASK_SETTINGS, "distributed.scheduler.allowed-failures", 0)
    with pytest.raises(WorkError, match=r"some cases killed every worker they ran on"):
        list(run_batches(lethal_rows, None, cases(2), workers=2))


def test_a_killed_client_goes_on_without_loss_or_double(small_tables: None, tmp_path: Path) -> None:
    file, out = written(tmp_path, cases=CASES), tmp_path / "rows"
    whole = without_time(run_campaign(file, tmp_path / "whole"))
    for wanted in (1, 6, 11):
        client = started("-m", "tests.campaign.small_cases", str(file), str(out))
        wait_until(lambda: parts(out) >= wanted or client.poll() is not None)  # noqa: B023 - called in this round only
        client.send_signal(signal.SIGKILL)
        client.wait()
        assert wanted <= parts(out) < CASES
    rows = run_campaign(file, out)
    assert [row["case"] for row in rows] == list(range(CASES))
    changed = [(a, b) for a, b in zip(without_time(rows), whole, strict=True) if a != b]
    assert not changed, changed[0]


def parts(out: Path) -> int:
    return len(list(out.glob("rows-*.parquet")))
