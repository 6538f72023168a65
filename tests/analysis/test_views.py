import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.analysis import views
from eddyscan.core.errors import TechniqueError

X = np.arange(0, 60, 0.25)
ROW = np.zeros(len(X), dtype=np.int64)
PLACE = np.stack([X, 0 * X, 0 * X], axis=1)


@given(st.floats(-720, 720), st.floats(-40, 40))
def test_rotation_and_gain_can_be_taken_back(angle, gain):
    signal = np.array([1 + 2j, -0.3j, 4.0])
    there = views.rotated(signal, angle, gain_db=gain)
    assert np.allclose(views.rotated(there, -angle, gain_db=-gain), signal)
    assert np.allclose(np.abs(there), np.abs(signal) * 10 ** (gain / 20))


def test_lift_off_lies_to_the_left():
    tangent = np.exp(1j * np.radians([70.0, 72.0, 68.0]))
    turned = views.rotated(tangent, views.lift_off_angle_deg(tangent))
    assert np.allclose(turned.real, -1.0, atol=0.01)


def test_filters_work_in_mm():
    long, short = np.sin(2 * np.pi * X / 20) + 0j, np.sin(2 * np.pi * X / 1.0) + 0j
    inside = slice(40, -40)
    low = views.low_pass(long + short, ROW, PLACE, cut_off_mm=4.0)
    assert np.abs(low - long)[inside].max() < 0.05
    high = views.high_pass(long + short, ROW, PLACE, cut_off_mm=4.0)
    assert np.allclose(low + high, long + short)
    at_cut_off = views.low_pass(np.sin(2 * np.pi * X / 4) + 0j, ROW, PLACE, cut_off_mm=4.0)
    assert np.abs(at_cut_off[inside]).max() == pytest.approx(0.5, abs=0.03)


def test_drift_between_references_is_taken_out():
    time = np.linspace(10, 110, 50)
    drift = (time - 5) / 110 * (0.02 + 0.01j)
    left = views.without_drift(3 + drift, time, before=(5.0, 1j), after=(115.0, 1j + 0.02 + 0.01j))
    assert np.allclose(left, 3)


def test_impossible_views_are_refused():
    with pytest.raises(TechniqueError, match=r"cut-off 0.3 mm is below two readings \(0.5 mm\) of row 0"):
        views.low_pass(X + 0j, ROW, PLACE, cut_off_mm=0.3)
    with pytest.raises(TechniqueError, match="must be later"):
        views.without_drift(X + 0j, X, before=(5.0, 0j), after=(5.0, 0j))
    assert np.array_equal(views.balanced(X + 1j, 1j), X + 0j)
