"""TEAM Workshop Problem 15 (Burke 1988), nothing fitted."""

import numpy as np
import pytest

from eddyscan.physics import slot_change_ohm
from eddyscan.physics.team15 import PLATE, PROBLEM_1, PROBLEM_2, SLOT, agreement, measured_problem_1


def signal(experiment, x_mm, y_mm=0.0):
    return slot_change_ohm(
        SLOT,
        experiment.coil,
        PLATE,
        experiment.frequency_hz,
        x_mm=x_mm,
        y_mm=y_mm,
        lift_off_mm=experiment.lift_off_mm,
    )


def test_problem_1_against_all_44_measured_rows():
    x_mm, measured = measured_problem_1()
    assert len(x_mm) == 44
    found = agreement(signal(PROBLEM_1, x_mm), measured)
    assert found.rms <= 0.025
    assert 0.98 <= found.peak_ratio <= 1.02
    assert found.phase_deg <= 4.0


def test_agreement_notices_a_wrong_model():
    _, measured = measured_problem_1()
    wrong = agreement(1.05 * measured * np.exp(0.1j), measured)
    assert wrong.peak_ratio == pytest.approx(1.05)
    assert wrong.phase_deg == pytest.approx(np.degrees(0.1))
    assert wrong.rms > 0.05


def test_problem_2_peaks_beyond_the_slot_end_like_problem_1():
    x_mm = np.arange(0.0, 40.0, 1.0)
    change = signal(PROBLEM_2, x_mm)
    assert 9 <= x_mm[np.abs(change).argmax()] <= 15
    assert np.abs(change[0]) < 0.5 * np.abs(change).max()
    assert np.abs(change[-1]) < 0.05 * np.abs(change).max()
