"""Clocks."""

import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.core.errors import InputError
from eddyscan.devices.clock import ScaledClock, VirtualClock, WallClock
from eddyscan.devices.protocols import Clock


@pytest.mark.parametrize("clock", [WallClock(), ScaledClock(10.0), VirtualClock()])
def test_all_are_clocks_that_do_not_run_backwards(clock):
    assert isinstance(clock, Clock)
    before = clock.now()
    clock.sleep(0.02)
    clock.sleep(-1.0)
    assert clock.now() - before >= 0.02 - 1e-9


def test_a_scaled_clock_sleeps_less_than_the_wall():
    clock, wall = ScaledClock(100.0), time.monotonic()
    clock.sleep(20.0)
    assert 0.2 <= time.monotonic() - wall < 10.0


@pytest.mark.parametrize("factor", [0.0, -1.0, float("inf"), float("nan")])
def test_an_impossible_factor_is_refused(factor):
    with pytest.raises(InputError, match="a clock cannot run"):
        ScaledClock(factor)


@given(st.lists(st.floats(0, 100), max_size=10))
def test_virtual_time_is_the_sum_of_waits(waits):
    clock = VirtualClock(5.0)
    for wait in waits:
        clock.sleep(wait)
    assert clock.now() == pytest.approx(5.0 + sum(waits))


def test_virtual_waits_of_several_threads_all_count():
    clock = VirtualClock()
    threads = [threading.Thread(target=lambda: [clock.sleep(0.001) for _ in range(500)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert clock.now() == pytest.approx(2.0)
