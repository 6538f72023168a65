"""POD estimators against curves that are known."""

import numpy as np
import pytest
from scipy.special import expit

from eddyscan.analysis.pod import hit_miss, signal_response
from eddyscan.core.errors import InputError

TRUE_A90 = float(np.exp(np.log(0.6) + 0.15 * np.log(9)))  # logit curve with mu = log 0.6, sigma = 0.15


def draw_hits(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(seed)
    sizes = np.exp(draw.uniform(np.log(0.3), np.log(1.5), n))
    return sizes, draw.random(n) < expit((np.log(sizes) - np.log(0.6)) / 0.15)


def test_hit_miss_recovers_a_known_curve() -> None:
    curve = hit_miss(*draw_hits(20_000, 1))
    assert curve.a90_mm == pytest.approx(TRUE_A90, rel=0.02)
    assert curve.a90_mm < curve.a90_95_mm < 1.05 * TRUE_A90


def test_the_upper_bound_holds_for_about_95_of_100_experiments() -> None:
    bounds = np.array([hit_miss(*draw_hits(300, seed)).a90_95_mm for seed in range(300)])
    assert 0.90 <= (bounds >= TRUE_A90).mean() <= 0.99


def test_signal_response_recovers_a_known_curve_and_its_bound() -> None:
    true_a90 = float(np.exp((np.log(3.0) - np.log(10.0)) / 1.5 + 1.2815515655 * 0.2 / 1.5))
    covered = 0
    for seed in range(300):
        draw = np.random.default_rng(seed)
        sizes = np.exp(draw.uniform(np.log(0.2), np.log(2.0), 100))
        signal = 10.0 * sizes**1.5 * np.exp(0.2 * draw.standard_normal(100))
        curve = signal_response(sizes, signal, threshold=3.0)
        assert curve.a90_mm == pytest.approx(true_a90, rel=0.1)
        covered += curve.a90_95_mm >= true_a90
    assert 0.90 <= covered / 300 <= 0.99


@pytest.mark.parametrize(
    ("sizes", "hits", "words"),
    [
        (np.linspace(0.1, 1, 20), np.linspace(0.1, 1, 20) > 0.5, "every hit is larger than every miss"),
        (np.linspace(0.1, 1, 20), np.ones(20, bool), "20 hits and 0 misses"),
    ],
)
def test_data_without_a_curve_are_refused(sizes: np.ndarray, hits: np.ndarray, words: str) -> None:
    with pytest.raises(InputError, match=words):
        hit_miss(sizes, hits)


def test_signals_that_fall_with_size_are_refused() -> None:
    sizes = np.linspace(0.1, 1, 20)
    with pytest.raises(InputError, match="do not grow"):
        signal_response(sizes, 1 / sizes, threshold=1.0)
