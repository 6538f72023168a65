"""The promises of a stage that follows timed paths, on top of `StageContract`'s."""

import numpy as np
import pytest

from eddyscan.core.errors import MotionError, TravelError
from eddyscan.devices.protocols import TimedPath


def wave_path(start: np.ndarray, *, length_mm=40.0, height_mm=3.0, speed_mm_s=20.0) -> TimedPath:
    """Along x with a smooth start and stop, while z makes one wave."""
    duration = 1.5 * length_mm / speed_mm_s
    t = np.linspace(0.0, duration, 61)
    u = t / duration
    share, rate = u - np.sin(2 * np.pi * u) / (2 * np.pi), (1 - np.cos(2 * np.pi * u)) / duration
    position, velocity = np.tile(start, (len(t), 1)), np.zeros((len(t), len(start)))
    position[:, 0] += length_mm * share
    velocity[:, 0] = length_mm * rate
    position[:, 2] += height_mm * np.sin(2 * np.pi * share)
    velocity[:, 2] = height_mm * 2 * np.pi * np.cos(2 * np.pi * share) * rate
    velocity[[0, -1]] = 0.0
    return TimedPath(t, position, velocity)


def drive(stage, clock, path, mode, each=lambda sample, began: None, round_s=0.02):
    began = stage.start_path(path, mode)
    while True:
        sample = stage.follow_path()
        each(sample, began)
        if not sample.moving:
            return
        clock.sleep(round_s)


class PathContract:
    """A fixture `path_stage` gives (stage homed at its path's start, clock, mode, start)."""

    following_error = 0.03

    def test_it_follows_a_wave_and_ends_at_its_end(self, path_stage):
        stage, clock, mode, start = path_stage
        path = wave_path(start)
        errors = []

        def note(sample, began):
            if 0.2 < sample.time_s[0] - began < path.duration_s - 0.2:
                ideal = [path.at(float(t) - began)[0][i] for i, t in enumerate(sample.time_s)]
                errors.append(np.abs(sample.position - ideal).max())

        drive(stage, clock, path, mode, note)
        assert len(errors) > 20
        assert np.percentile(errors, 95) < self.following_error
        assert stage.position() == pytest.approx(path.position[-1], abs=0.005)

    def test_a_path_begun_elsewhere_is_refused(self, path_stage):
        stage, _, mode, start = path_stage
        with pytest.raises(MotionError, match=r"axis x stands -5\.0000 mm from"):
            stage.start_path(wave_path(start + np.array([5.0, 0.0, 0.0])), mode)

    def test_a_path_beyond_the_travel_is_refused_before_anything_moves(self, path_stage):
        stage, _, mode, start = path_stage
        before = stage.position()
        with pytest.raises(TravelError, match="axis z is outside its travel"):
            stage.start_path(wave_path(start, height_mm=100.0), mode)
        assert stage.position() == pytest.approx(before, abs=1e-9)

    def test_a_stop_ends_the_path_with_an_error(self, path_stage):
        stage, clock, mode, start = path_stage
        stage.start_path(wave_path(start), mode)
        for _ in range(20):
            stage.follow_path()
            clock.sleep(0.02)
        stage.stop()
        with pytest.raises(MotionError, match="stopped on request"):
            stage.follow_path()

    def test_an_abandoned_path_comes_to_rest_on_the_path(self, path_stage, at_rest):
        """A computer that dies leaves axes that stop by themselves, not far from where they were."""
        stage, clock, mode, start = path_stage
        path = wave_path(start)
        stage.start_path(path, mode)
        for _ in range(50):
            last = stage.follow_path()
            clock.sleep(0.02)
        clock.sleep(1.5)
        assert at_rest()
        end = stage.position()
        assert 0.0 <= end[0] - last.position[0] < 20.0
        x, z = path.position[:, 0], path.position[:, 2]
        assert abs(end[2] - np.interp(end[0], x, z)) < 0.5
