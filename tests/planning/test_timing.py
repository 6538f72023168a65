"""Planned times against moves worked out by hand."""

import numpy as np
import pytest

from eddyscan.core.technique import Scan
from eddyscan.planning import MotionLimits
from eddyscan.planning.timing import arrival_times, move_times

LIMITS = MotionLimits((30.0, 30.0, 15.0), (100.0, 100.0, 50.0), reading_s=0.02, command_s=0.01)


@pytest.mark.parametrize(
    ("step", "speed", "seconds"),
    [
        ((20, 0, 0), 10.0, 20 / 10 + 10 / 100),  # cruise: length / v + v / a
        ((1, 0, 0), 25.0, 2 * np.sqrt(1 / 100)),  # never reaches the speed
        ((0, 0, 30), 25.0, 30 / 15 + 15 / 50),  # z is the slow axis
        ((30, 0, 30), 25.0, 30 / 15 + 15 / 50),  # arrive together: z sets the pace
        ((0, 0, 0), 25.0, 0.0),
    ],
)
def test_moves_from_rest_to_rest(step, speed, seconds):
    times = move_times(np.array([(0, 0, 0), step], dtype=float), np.full(2, speed), LIMITS)
    assert times[0] == pytest.approx(seconds)


def test_steps_pay_for_every_stop_and_rows_only_for_their_ends():
    positions = np.column_stack([np.arange(0, 101, 5.0), np.zeros(21), np.zeros(21)])
    speed, in_row = np.full(21, 20.0), np.ones(21, dtype=bool)
    step = arrival_times(positions, speed, in_row, Scan(mode="step", settle_s=0.1), LIMITS)
    each = 5 / 20 + 20 / 100 + 0.01 + 0.1 + 0.02
    np.testing.assert_allclose(np.diff(step), each)
    row = arrival_times(positions, speed, in_row, Scan(mode="row"), LIMITS)
    assert row[-1] == pytest.approx(100 / 20 + 20 / 50)
