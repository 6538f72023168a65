"""The study's stage experiment: recorded and true positions told apart."""

import numpy as np
import pytest

from eddyscan.core.errors import TravelError
from eddyscan.devices.clock import VirtualClock
from eddyscan.scanning import stage_experiment
from tests.devices.zaber_cell import zaber_cell


@pytest.fixture
def cell():
    with zaber_cell(VirtualClock()) as made:
        yield made


def wave(n=40):
    x = np.linspace(0.0, 200.0, n)
    return np.stack([x, np.full(n, 20.0), 20.0 + 7.5 * np.sin(2 * np.pi * x / 150.0)], axis=1)


def test_recorded_is_good_to_a_microstep_true_to_the_error_map(cell):
    result = stage_experiment(cell.stage, wave(), clock=cell.clock, true_position=cell.simulator.true_position)
    told = result.statistics_um()
    mean, sd = told["recorded"]["x"]
    assert abs(mean) < 0.024
    assert 0.005 < sd < 0.024
    assert told["true"]["x"][1] > 5.0


def test_without_a_virtual_cell_nobody_knows_the_truth(cell):
    assert set(stage_experiment(cell.stage, wave(3), clock=cell.clock).statistics_um()) == {"recorded"}


def test_points_outside_the_travel_are_refused_before_anything_moves(cell):
    before = cell.stage.position()
    with pytest.raises(TravelError, match=r"span x = 10\.00 to 210\.00 mm, the travel is 0\.00 to 203\.20 mm"):
        stage_experiment(cell.stage, wave() + np.array([10.0, 0, 0]), clock=cell.clock)
    assert cell.stage.position() == pytest.approx(before)
