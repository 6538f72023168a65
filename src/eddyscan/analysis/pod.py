"""Probability of detection: hit/miss and signal response, a90 and a90/95.

Models and confidence bounds as in MIL-HDBK-1823A: a logit of the logarithm of
size for hits and misses (its appendix G), a straight line of logarithms with
normal scatter for signals (its appendix H), bounds by the delta method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit
from scipy.stats import norm

from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array, BoolArray

P90 = 0.9
Z95 = float(norm.ppf(0.95))
STEPS = 100
LEAST_HITS = 5


@dataclass(frozen=True)
class PodCurve:
    """POD(a) = link((log a - mu) / sigma).

    Attributes
    ----------
    kind : "hit/miss" (logistic link) or "signal" (normal link)
    mu, sigma : location and scale in the natural logarithm of size [mm]
    covariance : (2, 2) of (mu, sigma)
    n : readings used
    """

    kind: str
    mu: float
    sigma: float
    covariance: Array
    n: int

    def at(self, size_mm: Array) -> Array:
        """Return the probability of detection (...) at sizes (...) [mm]."""
        z = (np.log(size_mm) - self.mu) / self.sigma
        return np.asarray(expit(z) if self.kind == "hit/miss" else norm.cdf(z))

    def size_mm(self, probability: float, *, confident: bool = False) -> float:
        """Return the size found with this probability; `confident`: its 95 % upper bound."""
        z = float(np.log(probability / (1 - probability)) if self.kind == "hit/miss" else norm.ppf(probability))
        log_size = self.mu + z * self.sigma
        if confident:
            gradient = np.array([1.0, z])
            log_size += Z95 * float(np.sqrt(gradient @ self.covariance @ gradient))
        return float(np.exp(log_size))

    @property
    def a90_mm(self) -> float:
        """Return the size found nine times in ten [mm]."""
        return self.size_mm(P90)

    @property
    def a90_95_mm(self) -> float:
        """Return its 95 % upper confidence bound [mm]."""
        return self.size_mm(P90, confident=True)


def hit_miss(size_mm: Array, hit: BoolArray) -> PodCurve:
    """Fit a logit POD to hits and misses by maximum likelihood.

    Parameters
    ----------
    size_mm : (N,) flaw sizes [mm]
    hit : (N,) found or not

    Raises
    ------
    InputError
        With fewer than five hits or misses, or when all hits are larger than all
        misses (no overlap: the slope has no finite estimate), or size does not help.
    """
    x, y = np.log(np.asarray(size_mm, dtype=float)), np.asarray(hit, dtype=float)
    _require_overlap(x, y)
    shift = float(x.mean())
    design = np.stack([np.ones_like(x), x - shift], axis=1)
    beta = np.zeros(2)
    for _ in range(STEPS):
        p = expit(design @ beta)
        information = (design * (p * (1 - p))[:, None]).T @ design
        step = np.linalg.solve(information, design.T @ (y - p))
        beta = beta + np.clip(step, -2.0, 2.0)
        if np.abs(step).max() < 1e-10:
            break
    if beta[1] <= 0:
        raise InputError("larger flaws are not found more often here: no POD curve over size. Vary the size more.")
    b0, b1 = float(beta[0]), float(beta[1])
    jacobian = np.array([[-1 / b1, b0 / b1**2], [0.0, -1 / b1**2]])
    covariance = jacobian @ np.linalg.inv(information) @ jacobian.T
    return PodCurve("hit/miss", shift - b0 / b1, 1 / b1, np.asarray(covariance), len(x))


def signal_response(size_mm: Array, signal: Array, *, threshold: float) -> PodCurve:
    """Fit log(signal) = b0 + b1 log(size) + normal scatter and return the POD at a call level.

    Parameters
    ----------
    size_mm : (N,) [mm]
    signal : (N,) above 0, any unit
    threshold : call level in the same unit

    Raises
    ------
    InputError
        With fewer than six signals or when signals do not grow with size.
    """
    x, y = np.log(np.asarray(size_mm, dtype=float)), np.log(np.asarray(signal, dtype=float))
    if len(x) < 6 or not np.isfinite(y).all():
        raise InputError(f"{len(x)} signals (need 6, all above 0) are too few for a POD curve.")
    design = np.stack([np.ones_like(x), x], axis=1)
    (b0, b1), *_ = np.linalg.lstsq(design, y, rcond=None)
    tau2 = float(((y - design @ np.array([b0, b1])) ** 2).sum() / (len(x) - 2))
    if b1 <= 0:
        raise InputError("signals do not grow with size here: no POD curve over size. Vary the size more.")
    tau = float(np.sqrt(tau2))
    mu, sigma = (np.log(threshold) - b0) / b1, tau / b1
    line = tau2 * np.linalg.inv(design.T @ design)
    to_mu = np.array([-1 / b1, -mu / b1])
    to_sigma = np.array([0.0, -sigma / b1])
    spread = tau2 / (2 * len(x)) / b1**2
    cross = float(to_mu @ line @ to_sigma)
    covariance = np.array([[to_mu @ line @ to_mu, cross], [cross, to_sigma @ line @ to_sigma + spread]])
    return PodCurve("signal", float(mu), float(sigma), covariance, len(x))


def _require_overlap(x: Array, y: Array) -> None:
    hits, misses = int(y.sum()), int((1 - y).sum())
    if min(hits, misses) < LEAST_HITS:
        raise InputError(
            f"{hits} hits and {misses} misses: a POD curve needs {LEAST_HITS} of each. Widen the range of sizes."
        )
    if x[y > 0].min() >= x[y == 0].max():
        raise InputError(
            "every hit is larger than every miss, so the curve's slope has no finite estimate. "
            "Add cases between the largest miss and the smallest hit."
        )
