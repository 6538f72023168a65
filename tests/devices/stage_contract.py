"""The promises of every stage: one suite, run on each driver with its simulator.

A driver's test module derives from `StageContract` and supplies the fixture
`stage`: connected, not yet homed, on a clock that runs faster than the wall's.
"""

import threading
import time

import numpy as np
import pytest

from eddyscan.core.errors import EddyscanError, MotionError, TravelError
from eddyscan.devices.protocols import Stage


class StageContract:
    """Tests only; no stage of its own."""

    tolerance = 0.005

    @pytest.fixture
    def homed(self, stage: Stage) -> Stage:
        stage.home()
        return stage

    def middle(self, stage: Stage) -> np.ndarray:
        return np.array([(axis.lower + axis.upper) / 2 for axis in stage.axes()])

    def test_it_is_a_stage(self, stage):
        assert isinstance(stage, Stage)

    def test_identity_says_who_answered_and_whether_hardware_was_tried(self, stage):
        identity = stage.identity()
        assert identity.kind
        assert identity.model
        assert identity.verified in (True, False)

    def test_axes_are_x_y_z_with_room_to_move(self, stage):
        axes = stage.axes()
        assert [axis.name for axis in axes[:3]] == ["x", "y", "z"]
        assert all(axis.upper > axis.lower and axis.resolution > 0 for axis in axes)
        assert all(axis.max_speed > 0 and axis.acceleration > 0 for axis in axes)

    def test_homing_gives_the_reference_and_lifts_the_probe(self, stage):
        stage.home()
        assert stage.is_homed()
        z = stage.axes()[2]
        assert stage.position()[2] == pytest.approx(z.upper, abs=0.1 * (z.upper - z.lower))

    def test_a_move_ends_at_its_target(self, homed):
        target = self.middle(homed) + 1.2345
        homed.move(target)
        assert homed.position() == pytest.approx(target, abs=self.tolerance)

    def test_moves_in_any_direction_end_at_their_targets(self, homed):
        rng, axes = np.random.default_rng(5), homed.axes()
        for _ in range(6):
            target = np.array([rng.uniform(axis.lower, axis.upper) for axis in axes])
            homed.move(target)
            assert homed.position() == pytest.approx(target, abs=self.tolerance)

    def test_a_move_to_where_it_stands_is_no_move(self, homed):
        here = homed.position()
        homed.move(here)
        assert homed.position() == pytest.approx(here, abs=self.tolerance)

    def test_a_move_is_no_faster_than_it_was_told(self, homed, clock):
        start = self.middle(homed)
        homed.move(start)
        before = clock.now()
        start[0] += 4.0
        homed.move(start, 2.0)
        assert clock.now() - before > 4.0 / 2.0

    @pytest.mark.parametrize("beyond", ["lower", "upper"])
    def test_a_target_outside_the_travel_is_refused_before_anything_moves(self, homed, beyond):
        before = homed.position()
        for index, axis in enumerate(homed.axes()):
            target = self.middle(homed)
            target[index] = axis.upper + 1.0 if beyond == "upper" else axis.lower - 1.0
            with pytest.raises(TravelError) as told:
                homed.move(target)
            assert f"axis {axis.name}" in str(told.value)
            assert f"{target[index]:.3f}" in str(told.value)
            assert f"{axis.upper:.3f}" in str(told.value)
        assert homed.position() == pytest.approx(before, abs=1e-9)

    @pytest.mark.parametrize("wrong", [np.zeros(2), np.zeros(7), np.array([np.nan, 1.0, 1.0])])
    def test_a_malformed_target_is_refused(self, homed, wrong):
        before = homed.position()
        with pytest.raises(EddyscanError):
            homed.move(wrong)
        assert homed.position() == pytest.approx(before, abs=1e-9)

    def test_stop_from_another_thread_ends_a_move_with_an_error(self, homed):
        start = self.middle(homed)
        start[0] = homed.axes()[0].lower + 1.0
        homed.move(start)
        end = start.copy()
        end[0] = homed.axes()[0].upper - 1.0
        caught: list[BaseException] = []
        mover = threading.Thread(target=lambda: _collect(caught, lambda: homed.move(end, 20.0)))
        mover.start()
        time.sleep(0.1)
        homed.stop()
        homed.stop()
        mover.join(10.0)
        assert not mover.is_alive()
        assert len(caught) == 1
        assert isinstance(caught[0], MotionError)
        assert start[0] < homed.position()[0] < end[0] - 1.0

    def test_a_stopped_stage_moves_again(self, homed):
        homed.stop()
        target = self.middle(homed)
        homed.move(target)
        assert homed.position() == pytest.approx(target, abs=self.tolerance)

    def test_stop_at_rest_and_twice_is_harmless(self, homed):
        before = homed.position()
        homed.stop()
        homed.stop()
        assert homed.position() == pytest.approx(before, abs=self.tolerance)

    def test_closing_twice_is_harmless(self, stage):
        stage.close()
        stage.close()


def _collect(caught, action):
    try:
        action()
    except BaseException as fault:
        caught.append(fault)
