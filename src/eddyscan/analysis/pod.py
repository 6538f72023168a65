"""Probability of detection, the ways of MIL-HDBK-1823A: signal against size, and hit or miss.

Curves from the virtual cell are simulations; `PodCurve.basis` says so wherever they go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import norm

from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array, BoolArray

LEAST_SIZES = 8
LEAST_HITS = 20
Z90, Z95 = float(norm.ppf(0.9)), float(norm.ppf(0.95))


@dataclass(frozen=True)
class PodCurve:
    """Normal cumulative curve of detection over the logarithm of size.

    Attributes
    ----------
    mu, sigma : location and scale of log(size in mm)
    covariance : (2, 2) of (mu, sigma)
    a50_mm, a90_mm, a90_95_mm : float [mm]
        Sizes found 50 and 90 times in 100, and the upper 95 % confidence limit of the latter.
    method : str
    basis : str
        Where the data come from, noise included.
    """

    mu: float
    sigma: float
    covariance: Array
    a50_mm: float
    a90_mm: float
    a90_95_mm: float
    method: str
    basis: str

    def at(self, size_mm: Array) -> Array:
        """Return the probability of detection (K,) at sizes (K,) [mm]."""
        return np.asarray(norm.cdf((np.log(size_mm) - self.mu) / self.sigma))


def pod_from_signals(
    size_mm: Array, signal: Array, *, threshold: float, basis: str, limits: tuple[float, float] | None = None
) -> PodCurve:
    """Fit log(signal) = b0 + b1 log(size) + normal scatter and turn it into a detection curve.

    Parameters
    ----------
    size_mm, signal : (K,) sizes [mm] and signals (for example signal to noise), all positive
    threshold : float
        Call level in the signal's unit.
    basis : str
    limits : (low, high), optional
        Signals at or below `low` (noise alone reaches it) and at or above `high` (the
        straight law ends) count as censored: only that they lie beyond is used.

    Raises
    ------
    InputError
        Fewer than 8 uncensored signals, no spread of size, or a signal that does not grow with size.
    """
    sound = np.isfinite(signal) & (signal > 0) & (size_mm > 0)
    low, high = limits or (0.0, np.inf)
    good = sound & (signal > low) & (signal < high)
    if good.sum() < LEAST_SIZES or np.ptp(np.log(size_mm[good])) < 0.05:
        raise InputError(
            f"{int(good.sum())} usable signals at {len(np.unique(size_mm[good]))} sizes are too few for a detection "
            f"curve (at least {LEAST_SIZES} at several sizes). Add flaws of other sizes."
        )
    x, y = np.log(size_mm[good]), np.log(signal[good])
    design = np.column_stack([np.ones_like(x), x])
    fit, *_ = np.linalg.lstsq(design, y, rcond=None)
    b0, b1 = float(fit[0]), float(fit[1])
    if b1 <= 0:
        raise InputError(f"the signal does not grow with size (slope {b1:.2f}); a detection curve needs one that does.")
    scatter = float(np.sqrt(((y - design @ fit) ** 2).sum() / (len(x) - 2)))
    full = np.zeros((3, 3))
    full[:2, :2], full[2, 2] = scatter**2 * np.linalg.inv(design.T @ design), scatter**2 / (2 * len(x))
    method = "signal against size, delta method"
    if (sound & ~good).any():
        start = np.array([b0, b1, scatter])
        (b0, b1, scatter), full = _censored(np.log(size_mm[sound]), signal[sound], (low, high), start)
        method = "signal against size, censored, delta method"
    mu, sigma = (np.log(threshold) - b0) / b1, scatter / b1
    slope = np.array([[-1 / b1, -mu / b1, 0.0], [0.0, -sigma / b1, 1 / b1]])
    return _curve(float(mu), sigma, slope @ full @ slope.T, method, basis)


def pod_from_hits(size_mm: Array, hit: BoolArray, *, basis: str) -> PodCurve:
    """Fit a cumulative normal of log(size) to hits and misses by maximum likelihood.

    Raises
    ------
    InputError
        Fewer than 20 trials, or hits and misses that do not overlap in size.
    """
    hits, misses = size_mm[hit], size_mm[~hit]
    if len(size_mm) < LEAST_HITS or len(hits) == 0 or len(misses) == 0 or misses.max() <= hits.min():
        raise InputError(
            f"{len(hits)} hits and {len(misses)} misses do not fix a detection curve (at least {LEAST_HITS} trials "
            "with sizes that are found sometimes and missed sometimes). Add sizes near the limit."
        )
    x = np.log(size_mm)

    def cost(parameters: Array) -> float:
        z = (x - parameters[0]) / np.exp(parameters[1])
        return -float(norm.logcdf(np.where(hit, z, -z)).sum())

    start = np.array([float(np.median(x)), np.log(max(float(x.std()), 0.05))])
    best = minimize(cost, start, method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-8})
    mu, sigma = float(best.x[0]), float(np.exp(best.x[1]))
    covariance = np.linalg.inv(_hessian(lambda p: cost(np.array([p[0], np.log(p[1])])), np.array([mu, sigma])))
    return _curve(mu, sigma, np.asarray(covariance), "hit or miss, maximum likelihood", basis)


def _censored(x: Array, signal: Array, limits: tuple[float, float], start: Array) -> tuple[Array, Array]:
    """Return (b0, b1, scatter) of greatest likelihood and their covariance (3, 3) (MIL-HDBK-1823A, G.3)."""
    below, above = signal <= limits[0], signal >= limits[1]
    y = np.log(np.clip(signal, *limits))

    def cost(b0: float, b1: float, scatter: float) -> float:
        z = (y - b0 - b1 * x) / scatter
        known = norm.logpdf(z) - np.log(scatter)
        return -float(np.where(below, norm.logcdf(z), np.where(above, norm.logsf(z), known)).sum())

    def free(p: Array) -> float:
        return cost(float(p[0]), float(p[1]), float(np.exp(p[2])))

    first = np.array([start[0], start[1], np.log(start[2])])
    best = minimize(free, first, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 4000})
    fit = np.array([best.x[0], best.x[1], np.exp(best.x[2])])
    return fit, np.asarray(np.linalg.inv(_hessian(lambda p: cost(p[0], p[1], p[2]), fit)))


def _curve(mu: float, sigma: float, covariance: Array, method: str, basis: str) -> PodCurve:
    a90 = mu + Z90 * sigma
    slope = np.array([1.0, Z90])
    deviation = float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
    a50_mm, a90_mm, a90_95_mm = (float(np.exp(v)) for v in (mu, a90, a90 + Z95 * deviation))
    return PodCurve(mu, sigma, covariance, a50_mm, a90_mm, a90_95_mm, method, basis)


def _hessian(cost: Callable[[Array], float], at: Array) -> Array:
    step = 1e-3 * np.maximum(np.abs(at), 0.1)
    n = len(at)
    out = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            a, b = step[i] * np.eye(n)[i], step[j] * np.eye(n)[j]
            values = [cost(at + s * a + t * b) for s, t in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
            out[i, j] = (values[0] - values[1] - values[2] + values[3]) / (4 * step[i] * step[j])
    return out
