"""The driver of `docs/how-to/add-a-stage.md` is a working one: it passes the contract suite."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from eddyscan.core.errors import MotionError
from eddyscan.devices.clock import ScaledClock
from tests.devices.stage_contract import StageContract

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(f"examples_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


class TestMyStage(StageContract):
    @pytest.fixture
    def clock(self):
        return ScaledClock(40.0)

    @pytest.fixture
    def stage(self, clock):
        device = example("my_stage_simulated").MyDevice(clock)
        stage = example("my_stage").MyStage(device.address, clock)
        yield stage
        stage.close()
        device.close()

    def test_it_refuses_to_move_without_reference(self, stage):
        with pytest.raises(MotionError, match="no reference"):
            stage.move(np.array([20.0, 20.0, 20.0]))


def test_the_driver_is_short():
    assert len((EXAMPLES / "my_stage.py").read_text().splitlines()) < 100
