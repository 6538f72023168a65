"""Timed paths through the points of a row, and the delay fitted from a line driven both ways."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.devices.protocols import Axis
from eddyscan.scanning.latency import fit_latency
from eddyscan.scanning.rows import strokes
from eddyscan.scanning.stepping import legs
from eddyscan.scanning.trajectory import row_path

AXES = (
    Axis("x", 0.0, 203.2, 5e-5, 29.0, 200.0),
    Axis("y", 0.0, 203.2, 5e-5, 29.0, 200.0),
    Axis("z", 0.0, 40.0, 1e-4, 24.0, 200.0),
)


def wave(n, height, length=150.0):
    x = np.linspace(0.0, length, n)
    return np.stack([x, np.full(n, 20.0), 20.0 + height * np.sin(2 * np.pi * x / 140.0)], axis=1)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 60), st.floats(0.0, 15.0), st.floats(1.0, 40.0))
def test_a_path_passes_every_point_in_order_within_the_axes_limits(n, height, speed):
    points = wave(n, height)
    row = row_path(points, speed, AXES)
    assert (np.diff(row.passes_s) > 0).all()
    assert row.passes_s[0] == 0.0
    assert row.passes_s[-1] == pytest.approx(row.path.duration_s)
    at = np.array([row.path.at(float(t))[0] for t in row.passes_s])
    assert np.abs(at - points).max() < 0.05
    times = np.linspace(0, row.path.duration_s, 800)
    velocity = np.array([row.path.at(float(t))[1] for t in times])
    assert (np.abs(velocity) <= np.array([a.max_speed for a in AXES]) * 1.02).all()
    change = np.abs(np.diff(velocity, axis=0)) / (times[1] - times[0])
    assert (np.percentile(change, 99, axis=0) <= np.array([a.acceleration for a in AXES]) * 1.05).all()
    assert np.linalg.norm(velocity, axis=1).max() <= row.speed_mm_s * 1.02


def test_the_speed_is_constant_between_the_ramps():
    row = row_path(wave(31, 15.0), 25.0, AXES)
    ramp = 0.3
    times = np.linspace(ramp, row.path.duration_s - ramp, 300)
    speed = [np.linalg.norm(row.path.at(float(t))[1]) for t in times]
    assert np.ptp(speed) < 0.3
    assert np.mean(speed) == pytest.approx(row.speed_mm_s, rel=0.01)


def test_a_steep_row_is_driven_as_slowly_as_its_weakest_axis_needs():
    weak = (*AXES[:2], Axis("z", 0.0, 40.0, 1e-4, 5.0, 200.0))
    assert row_path(wave(31, 15.0), 25.0, weak).speed_mm_s < 10.0
    assert row_path(wave(31, 15.0), 25.0, AXES).speed_mm_s == pytest.approx(25.0)


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.05, 0.1), st.floats(0.0, 0.01), st.floats(0.3, 3.0))
def test_delay_and_backlash_are_told_apart(delay, backlash, decay_mm):
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 6.0, 0.01)
    fast, slow = np.clip(t, 0, 1), np.clip(t - 2.0, 0, 2)
    z = 2 * np.where(fast < 0.5, 2 * fast, 2 - 2 * fast) + 2 * np.where(slow < 1, slow, 2 - slow)
    rate = np.gradient(z, t)
    seen = np.interp(t - delay, t, z - 0.5 * backlash * np.sign(np.round(rate, 9)))
    values = 100 + 50j * np.exp(-seen / decay_mm) + rng.normal(0, 0.01, len(t))
    found = fit_latency(t, values, t, z)
    assert found.seconds == pytest.approx(delay, abs=0.0015)
    assert found.uncertainty_s < 0.002


def test_a_signal_without_contrast_tells_no_delay():
    rng, t = np.random.default_rng(2), np.arange(0.0, 4.0, 0.02)
    z = np.abs(np.mod(t, 2.0) - 1.0) * 2
    values = rng.normal(0, 0.01, len(t)) + 1j * rng.normal(0, 0.01, len(t))
    assert fit_latency(t, values, t, z).uncertainty_s > 0.004


@given(st.lists(st.booleans(), min_size=1, max_size=30))
def test_legs_and_strokes_visit_exactly_what_is_missing(done):
    kind = np.array([2, *([0] * len(done))])
    row = np.array([0, *[0 if k < 15 else 1 for k in range(len(done))]])
    to_go = legs(kind, [False, *done])
    assert [leg[-1] for leg in to_go] == [k + 1 for k, d in enumerate(done) if not d]
    runs = [run for _, run in strokes(to_go, row)]
    assert [k for run in runs for k in run] == [leg[-1] for leg in to_go]
    for run in runs:
        assert run == list(range(run[0], run[-1] + 1))
        assert len({row[k] for k in run}) == 1
