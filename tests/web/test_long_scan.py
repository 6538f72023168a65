"""Half an hour's worth of readings with two pages open: nothing missed, nothing piles up, pages stay quick."""

from __future__ import annotations

import time
from typing import Any

import psutil
import pytest

from tests.web.browser import Hand, chromium
from tests.web.shelf_on_disk import behave

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.timeout(300)]
READINGS = 20_000
GROWTH_BYTES = 50e6


def heap(hand: Hand) -> float:
    """Return what the page's scripts hold after a collection [bytes]."""
    hand.driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    return float(hand.js("return performance.memory.usedJSHeapSize"))


def resident(served: Any) -> list[float]:
    pids = (served.door.bench.worker_pid, served.door.library.pid)
    return [float(psutil.Process(pid).memory_info().rss) for pid in pids]


def test_long_scan_with_two_pages(served, inspection):
    behave(inspection, readings=READINGS, batch=100, interval_s=0.06)
    with chromium() as first, chromium() as second:
        hands = [Hand(driver, served.running.address) for driver in (first, second)]
        for hand in hands:
            hand.open("plate-1/record")
            hand.find("#do-record")
            hand.js(
                "window.updates = 0; const seen = eddyscan.news.bind(eddyscan);"
                "eddyscan.news = (news) => { window.updates += news.readings?.length ? 1 : 0; seen(news); };"
            )
        heaps = [heap(hand) for hand in hands]
        hands[0].click("#do-record")
        hands[0].wait(lambda: hands[0].js("return eddyscan.readings.count") > 2000, 30)
        served.visitor().ask("scene", name="plate-1", scene="record")  # what it loads at first use is no growth
        before, began = resident(served), time.monotonic()
        hands[0].job_is("record", "done", seconds=100)
        took = time.monotonic() - began
        for hand in hands:
            hand.wait(lambda hand=hand: hand.js("return eddyscan.readings.count") == READINGS, 30)
            assert hand.js("return new Set(eddyscan.readings.seen.keys()).size") == READINGS
        grown = [after - start for after, start in zip(resident(served), before, strict=True)]
        rates = [hand.js("return window.updates") / took for hand in hands]
        grown += [heap(hand) - start for hand, start in zip(hands, heaps, strict=True)]
        print(f"grown MB: {[round(value / 1e6, 1) for value in grown]}; updates/s: {rates}; {took:.1f} s")
        assert max(grown) < GROWTH_BYTES
        assert min(rates) > 2  # ten on an idle machine; the drawing here is in software
