"""Motion at constant acceleration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.devices.trapezoid import brake, move, rest_to_rest_s

place = st.floats(-100, 100)
speed = st.floats(0.1, 50)
strength = st.floats(1, 500)
velocity = st.floats(-60, 60)


@given(place, place, speed, strength, velocity)
def test_every_move_ends_at_rest_at_its_target(start, target, top, a, v):
    motion = move(start, target, speed=top, acceleration=a, velocity=v)
    assert motion.end == pytest.approx(target, abs=1e-6)
    assert motion.state(motion.duration + 1.0) == (pytest.approx(target, abs=1e-6), 0.0)


@given(place, place, speed, strength, velocity)
def test_position_and_speed_never_jump_and_stay_within_limits(start, target, top, a, v):
    motion = move(start, target, speed=top, acceleration=a, velocity=v)
    times = np.linspace(0, motion.duration, 400)
    states = np.array([motion.state(float(t)) for t in times])
    dt = motion.duration / 399
    largest = max(top, abs(v))
    assert np.abs(np.diff(states[:, 0])).max() <= largest * dt + 1e-6
    assert np.abs(np.diff(states[:-1, 1])).max(initial=0.0) <= a * dt + 1e-6
    assert np.abs(states[:, 1]).max() <= largest + 1e-6


@given(st.floats(0.001, 200), speed, strength)
def test_rest_to_rest_takes_the_textbook_time(distance, top, a):
    expected = distance / top + top / a if distance >= top * top / a else 2 * np.sqrt(distance / a)
    assert rest_to_rest_s(distance, top, a) == pytest.approx(expected)


@given(velocity, strength)
def test_braking_takes_the_stopping_distance(v, a):
    assert brake(0.0, v, a).end == pytest.approx(np.sign(v) * v * v / (2 * a), abs=1e-9)
