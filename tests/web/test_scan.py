"""The scan through the page: seen by every page, paused, stopped, gone on with; whatever dies."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from eddyscan.formats.records import read_record
from tests.web.conftest import LINE
from tests.web.shelf_on_disk import behave
from tests.web.visitor import Visitor, job_state, news_until

SERVE = (
    "import asyncio, sys\n"
    "from pathlib import Path\n"
    "from eddyscan.web.door import open_door\n"
    "async def main():\n"
    "    running = await open_door(Path(sys.argv[1]), line=sys.argv[2])\n"
    "    print(running.door.access.port, running.door.access.operator_token, flush=True)\n"
    "    await asyncio.Event().wait()\n"
    "asyncio.run(main())\n"
)


def stops(inspection) -> list[float]:
    path = inspection.folder / "stops.txt"
    return [float(line) for line in path.read_text().splitlines()] if path.is_file() else []


def seen_readings(news: list[dict]) -> list[tuple[float, float]]:
    return [(row[0], row[1]) for one in news if "answer" not in one for row in one["readings"]]


def test_two_pages_see_every_reading_once_and_in_order(served, inspection):
    behave(inspection, interval_s=0.01)
    visitor = served.visitor()
    with visitor.live() as one, visitor.live() as two:
        assert visitor.run("plate-1", "record")[0] == 200
        first, second = (news_until(wire, job_state("done")) for wire in (one, two))
    record = read_record(inspection.file("record", "record.sqlite"))
    expected = list(zip(record.row.tolist(), record.point.tolist(), strict=True))
    assert seen_readings(first) == seen_readings(second) == expected
    lift_off = [row[9] for news in first if "answer" not in news for row in news["readings"]]
    assert all(value is None or -1 < value < 5 for value in lift_off)


def test_page_that_opens_late_gets_what_was_read_before(served, inspection):
    behave(inspection, interval_s=0.01)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        news_until(wire, lambda news: news["total"] > 20)
        with visitor.live() as late:
            assert len(seen_readings(news_until(late, job_state("done")))) == 100


def test_pause_holds_and_go_on_goes_on(served, inspection):
    behave(inspection, interval_s=0.03)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        news_until(wire, lambda news: news["total"] > 3)
        visitor.do("pause")
        held = news_until(wire, job_state("paused"))[-1]["total"]
        time.sleep(0.5)
        assert len(read_record(inspection.file("record", "record.sqlite"))) <= held + 2
        assert not stops(inspection)
        wire.send(json.dumps({"do": "resume"}))
        news_until(wire, job_state("done"))
    assert len(read_record(inspection.file("record", "record.sqlite"))) == 100


@pytest.mark.parametrize("held", [False, True])
def test_stop_in_a_row_keeps_the_record_and_the_scan_goes_on(served, inspection, held):
    behave(inspection, interval_s=0.03)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        news_until(wire, lambda news: news["total"] > 13)
        if held:
            visitor.do("pause")
            news_until(wire, job_state("paused"))
        wire.send(json.dumps({"do": "stop"}))
        last = news_until(wire, job_state("stopped"))[-1]
        assert stops(inspection)
        assert last["stop_ms"] < 500
        kept = len(read_record(inspection.file("record", "record.sqlite")))
        assert 13 < kept < 100
        behave(inspection, interval_s=0.002)
        visitor.run("plate-1", "record")
        after = news_until(wire, job_state("done"))
    record = read_record(inspection.file("record", "record.sqlite"))
    assert len(record) == 100 == len({*zip(record.row.tolist(), record.point.tolist(), strict=True)})
    assert len(seen_readings(after)) == 100 - kept


def test_stop_between_two_steps_ends_the_chain(served, inspection):
    behave(inspection, ticks=50, tick_s=0.05)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "surface", "plan", "cscan")
        news_until(wire, lambda news: news["job"] is not None and news["job"]["done"] > 0)
        visitor.do("stop")
        last = news_until(wire, job_state("stopped"))[-1]
        time.sleep(0.3)
        assert last["job"]["step"] == "surface"
        assert "the folder is as it was before" in last["job"]["message"]
        assert served.door.bench.job.number == 1


def test_chain_of_steps_runs_to_its_end(served, inspection):
    behave(inspection, warn=True)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "surface", "plan")
        seen = news_until(
            wire, lambda n: n["job"] is not None and n["job"]["step"] == "plan" and not n["job"]["active"]
        )
    log = [entry["message"] for news in seen if "answer" not in news for entry in news["log"]]
    assert "Surface started by the operator." in log
    assert "the second view hangs loosely" in log
    assert any(line.startswith("Plan done in") for line in log)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"refuse": True}, "coverage is 40 %, the technique demands 95 %. Lower the pitch."),
        ({"break": True}, "failed in a way nobody foresaw: ZeroDivisionError"),
        ({"die": True}, "the work process ended unexpectedly (code 7)"),
    ],
)
def test_failed_step_says_why_and_the_next_one_runs(served, inspection, how, words):
    visitor = served.visitor()
    behave(inspection, **how)
    with visitor.live() as wire:
        visitor.run("plate-1", "plan")
        assert words in news_until(wire, job_state("failed"))[-1]["job"]["message"]
        behave(inspection)
        assert visitor.run("plate-1", "plan")[0] == 200
        news_until(wire, job_state("done"))


def test_unknown_steps_and_idle_buttons_are_refused_in_words(served):
    visitor = served.visitor()
    assert "there is no step" in visitor.run("plate-1", "explode")[1]["error"]
    assert "there is no step" in visitor.run("plate-1")[1]["error"]
    assert "no scan is under way" in visitor.do("pause")[1]["error"]
    assert visitor.do("stop")[0] == 200


def test_axes_stop_when_the_door_dies(inspection):
    behave(inspection, interval_s=0.05)
    command = [sys.executable, "-c", SERVE, str(inspection.folder.parent), LINE]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    door = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert door.stdout is not None
        port, token = door.stdout.readline().split()
        children = psutil.Process(door.pid).children()
        visitor = Visitor(int(port), token)
        with visitor.live() as wire:
            visitor.run("plate-1", "record")
            news_until(wire, lambda news: news["total"] > 3)
        assert not stops(inspection)
        door.send_signal(signal.SIGKILL)
        door.wait(5)
        psutil.wait_procs(children, timeout=8)
        assert stops(inspection)
        assert not [child for child in children if child.is_running()]
        assert len(read_record(inspection.file("record", "record.sqlite"))) > 3
    finally:
        door.kill()
        door.wait(5)
        door.stdout.close()


def test_slow_page_holds_up_nobody_and_nothing_piles_up(served, inspection):
    behave(inspection, readings=20_000, batch=200, interval_s=0.02)
    visitor = served.visitor()
    with visitor.live(max_queue=1) as stuck, visitor.live() as quick:
        began = psutil.Process(served.door.bench.worker_pid).memory_info().rss
        visitor.run("plate-1", "record")
        seen = news_until(quick, job_state("done"), seconds=60)
        while len(seen_readings(seen)) < 20_000:
            seen += news_until(quick, lambda news: True)
        assert len(set(seen_readings(seen))) == 20_000
        del stuck
    assert psutil.Process(served.door.bench.worker_pid).memory_info().rss - began < 120e6


def test_job_is_told_by_folder_and_reading_count_by_the_overview(served, inspection):
    behave(inspection, interval_s=0.0)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        assert Path(news_until(wire, job_state("done"))[-1]["job"]["folder"]) == inspection.folder
    steps = {step["name"]: step for step in visitor.ask("overview", name="plate-1")[1]["steps"]}
    assert steps["record"]["figure"] == "100 of 100 readings"
    assert steps["record"]["state"] == "done"
    assert steps["align"]["state"] == "done"


def test_second_pass_begins_anew_on_every_page(served, inspection):
    behave(inspection, interval_s=0.01, passes=2)
    visitor = served.visitor()
    with visitor.live() as wire:
        visitor.run("plate-1", "record")
        seen = news_until(wire, job_state("done"))
        with visitor.live() as late:
            shown = seen_readings(news_until(late, lambda news: news["total"] == 100))
    numbers = [news["scan"] for news in seen if "answer" not in news and news["readings"]]
    assert sorted(set(numbers)) == [1, 2]
    second = [news for news in seen if "answer" not in news and news["scan"] == 2]
    assert all(news["anew"] for news in second)
    assert len(seen_readings(second)) == len(shown) == 100
    steps = {step["name"]: step for step in visitor.ask("overview", name="plate-1")[1]["steps"]}
    assert steps["record"]["figure"] == "100 of 100 readings"
