"""From what varies to the list of cases: the same for the same seed, whatever runs them."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from eddyscan.campaign.settings import Campaign, Choice, Normal, Range, Ratio, Variation
from eddyscan.core.errors import TechniqueError

Column = NDArray[Any]
MAX_FACTORIAL = 10_000_000


def draw_cases(campaign: Campaign, known: set[str]) -> dict[str, Column]:
    """Return parameter name -> one value per case.

    Parameters
    ----------
    campaign : Campaign
    known : set of str
        Parameter names a case understands.

    Raises
    ------
    TechniqueError
        For an unknown parameter, a multiple of an unknown one, or a factorial
        design beyond ten million cases.
    """
    _check_names(campaign.vary, known)
    free = {name: rule for name, rule in campaign.vary.items() if isinstance(rule, (Range, Normal, Choice))}
    columns = _factorial(free) if campaign.campaign.design == "factorial" else _sampled(free, campaign)
    n = len(next(iter(columns.values()))) if columns else campaign.campaign.cases
    for name, rule in campaign.vary.items():
        if isinstance(rule, (float, int, str)):
            columns[name] = np.full(n, rule)
    for name, rule in campaign.vary.items():
        if isinstance(rule, Ratio):
            columns[name] = columns[rule.of].astype(float) * rule.times
    return {name: columns[name] for name in sorted(columns)}


def case_seeds(campaign: Campaign, n: int) -> list[int]:
    """Return one independent seed per case, tied to the case's number."""
    states = np.random.SeedSequence(campaign.campaign.seed, spawn_key=(1,)).generate_state(n, np.uint64)
    return [int(state >> np.uint64(1)) for state in states]  # 63 bits: the widest integer of a Parquet column


def _check_names(vary: dict[str, Variation], known: set[str]) -> None:
    for name, rule in vary.items():
        if name not in known:
            raise TechniqueError(f"vary.{name}: unknown parameter; known are {', '.join(sorted(known))}.")
        if isinstance(rule, Ratio) and (rule.of not in vary or isinstance(vary[rule.of], Ratio)):
            raise TechniqueError(f"vary.{name}: is a multiple of {rule.of!r}, which does not vary by itself here.")


def _sampled(free: dict[str, Any], campaign: Campaign) -> dict[str, Column]:
    head = campaign.campaign
    names = sorted(free)
    if not names:
        return {}
    generator = np.random.default_rng(np.random.SeedSequence(head.seed, spawn_key=(0,)))
    if head.design == "latin-hypercube":
        unit = qmc.LatinHypercube(d=len(names), rng=generator).random(head.cases)
    else:
        unit = generator.random((head.cases, len(names)))
    return {name: _values(free[name], unit[:, k]) for k, name in enumerate(names)}


def _factorial(free: dict[str, Any]) -> dict[str, Column]:
    names = sorted(free)
    levels = [_levels(free[name]) for name in names]
    total = int(np.prod([len(level) for level in levels])) if levels else 0
    if total > MAX_FACTORIAL:
        raise TechniqueError(f"the factorial design has {total} cases (limit {MAX_FACTORIAL}); use fewer steps.")
    rows = list(itertools.product(*levels))
    return {name: np.array([row[k] for row in rows]) for k, name in enumerate(names)} if rows else {}


def _levels(rule: Any) -> Column:
    if isinstance(rule, Choice):
        return np.array(rule.list)
    if isinstance(rule, Normal):
        return _values(rule, (np.arange(rule.steps) + 0.5) / rule.steps)
    return _values(rule, np.linspace(0.0, 1.0, rule.steps))


def _values(rule: Any, unit: NDArray[np.float64]) -> Column:
    if isinstance(rule, Choice):
        index = np.minimum((unit * len(rule.list)).astype(int), len(rule.list) - 1)
        return np.asarray(np.array(rule.list)[index])
    if isinstance(rule, Normal):
        return np.asarray(norm.ppf(np.clip(unit, 1e-12, 1 - 1e-12), *rule.normal))
    low, high = rule.uniform
    if rule.log:
        return np.asarray(np.exp(np.log(low) + unit * (np.log(high) - np.log(low))))
    return np.asarray(low + unit * (high - low))
