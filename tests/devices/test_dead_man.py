"""The second process that says stop for a killed one."""

import os
import signal
import subprocess
import sys
import time

import pytest

from eddyscan.devices.clock import ScaledClock
from eddyscan.devices.dead_man import DeadMan
from eddyscan.devices.sim.zaber import ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings

CHILD = """
import sys, time
from eddyscan.devices.dead_man import DeadMan
DeadMan((sys.argv[1], int(sys.argv[2])), b"/stop\\n")
print("ready", flush=True)
time.sleep(60)
"""


@pytest.fixture
def moving_stage():
    simulator = ZaberSimulator(ZaberSettings(), ScaledClock(1.0))
    host, port = simulator.start()
    simulator.answer(b"/0 0 move max\n")
    yield simulator, host, port
    simulator.close()


def at_rest_within(simulator, seconds):
    until = time.monotonic() + seconds
    while simulator.moving() and time.monotonic() < until:
        time.sleep(0.01)
    return not simulator.moving()


def test_a_killed_program_leaves_axes_at_rest(moving_stage):
    simulator, host, port = moving_stage
    child = subprocess.Popen([sys.executable, "-c", CHILD, host, str(port)], stdout=subprocess.PIPE)
    assert child.stdout.readline() == b"ready\n"
    assert simulator.moving()
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    assert at_rest_within(simulator, 3.0)


def test_a_dismissed_dead_man_stays_silent(moving_stage):
    simulator, host, port = moving_stage
    guard = DeadMan((host, port), b"/stop\n")
    guard.dismiss()
    guard.dismiss()
    assert simulator.commands_seen == 1
    assert simulator.moving()
