"""Simulated devices in a process of their own."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest

from eddyscan.devices.clock import ScaledClock
from eddyscan.devices.drivers.grbl import GrblStage, GrblStageSettings
from eddyscan.devices.drivers.zaber import ZaberStage
from eddyscan.devices.drivers.zaber_settings import ZaberStageSettings

STAGES = {
    "zaber": (ZaberStage, ZaberStageSettings, np.array([10.0, 10.0, 35.0])),
    "grbl": (GrblStage, GrblStageSettings, np.array([290.0, 190.0, 55.0])),
}


@pytest.mark.parametrize("name", ["zaber", "grbl"])
def test_a_served_device_is_found_moved_and_ended(name):
    code = f"from eddyscan.devices.sim.{name} import serve_{name}; serve_{name}(0, speed_factor=20.0)"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    try:
        said = process.stdout.readline()
        host, port = re.search(r"on ([\d.]+):(\d+)", said).groups()
        kind, settings, target = STAGES[name]
        stage = kind(settings(host=host, port=int(port), dead_man=False), ScaledClock(20.0))
        stage.home()
        stage.move(target)
        assert stage.position() == pytest.approx(target, abs=0.002)
        stage.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0
        assert process.stdout.read() == "stopped\n"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
