import numpy as np
import pytest
from scipy.stats import norm

from eddyscan.analysis.pod import pod_from_hits, pod_from_signals
from eddyscan.core.errors import InputError

RNG = np.random.default_rng(3)
SIZES = np.exp(RNG.uniform(np.log(0.2), np.log(3.0), 400))
SIGNAL = np.exp(1.5 + 1.6 * np.log(SIZES) + 0.3 * RNG.standard_normal(400))
TRUE_A90 = float(np.exp((np.log(6.0) - 1.5) / 1.6 + norm.ppf(0.9) * 0.3 / 1.6))


def test_the_size_found_nine_times_in_ten_from_signals():
    curve = pod_from_signals(SIZES, SIGNAL, threshold=6.0, basis="simulated")
    assert curve.a90_mm == pytest.approx(TRUE_A90, rel=0.04)
    assert curve.a50_mm < curve.a90_mm < curve.a90_95_mm < 1.15 * curve.a90_mm
    assert curve.at(np.array([curve.a90_mm]))[0] == pytest.approx(0.9)
    assert curve.basis == "simulated"


def test_the_same_from_hits_and_misses():
    curve = pod_from_hits(SIZES, SIGNAL > 6.0, basis="simulated")
    assert curve.a90_mm == pytest.approx(TRUE_A90, rel=0.10)
    assert curve.a90_mm < curve.a90_95_mm


def test_a_noise_floor_and_saturation_do_not_bend_the_curve():
    seen = np.clip(SIGNAL, 3.0, 20.0)
    curve = pod_from_signals(SIZES, seen, threshold=6.0, basis="simulated", limits=(3.0, 20.0))
    assert curve.a90_mm == pytest.approx(TRUE_A90, rel=0.04)
    assert curve.a90_mm < curve.a90_95_mm < 1.15 * curve.a90_mm
    bent = pod_from_signals(SIZES, seen, threshold=6.0, basis="simulated")
    assert abs(bent.a90_mm / TRUE_A90 - 1) > 0.04


def test_the_censored_confidence_limit_holds_in_19_of_20():
    held = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        size = np.exp(rng.uniform(np.log(0.3), np.log(3.0), 60))
        signal = np.exp(1.5 + 1.6 * np.log(size) + 0.3 * rng.standard_normal(60))
        curve = pod_from_signals(size, signal, threshold=6.0, basis="-", limits=(3.0, 20.0))
        held += curve.a90_95_mm > TRUE_A90
    assert 0.86 <= held / 60 < 1.0


def test_the_confidence_limit_holds_in_19_of_20():
    held = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        size = np.exp(rng.uniform(np.log(0.3), np.log(3.0), 40))
        signal = np.exp(1.5 + 1.6 * np.log(size) + 0.3 * rng.standard_normal(40))
        held += pod_from_signals(size, signal, threshold=6.0, basis="-").a90_95_mm > TRUE_A90
    assert held / 60 >= 0.86


def test_data_that_fix_no_curve_are_refused():
    with pytest.raises(InputError, match=r"3 usable signals at 3 sizes are too few.*at least 8"):
        pod_from_signals(SIZES[:3], SIGNAL[:3], threshold=6.0, basis="-")
    with pytest.raises(InputError, match="does not grow with size"):
        pod_from_signals(SIZES, 1 / SIGNAL, threshold=6.0, basis="-")
    with pytest.raises(InputError, match="400 hits and 0 misses do not fix"):
        pod_from_hits(SIZES, np.ones(400, dtype=bool), basis="-")
