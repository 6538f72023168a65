"""From pairs to one set of poses: the best reference view, every loop checked, bad views named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array, invert
from eddyscan.surface.pose_search import PairPose, PairSearch

COST_LIMIT_MM = 0.75  # truncated mean height difference of views that do not show the same scene
OVERLAP_LIMIT = 0.2


@dataclass(frozen=True)
class ViewGraph:
    """Poses of all usable views in the reference view's table frame.

    Attributes
    ----------
    reference : int
    poses : T_reference_view between table frames; None for a rejected view
    cost_mm : (K, K) mean truncated height difference of every pair at the final poses
    rejected : (view index, reason) pairs
    pairs : every pair's own best pose
    """

    reference: int
    poses: tuple[Array | None, ...]
    cost_mm: Array
    rejected: tuple[tuple[int, str], ...]
    pairs: dict[tuple[int, int], PairPose]


def connect(search: PairSearch, names: Sequence[str]) -> ViewGraph:
    """Place views one after another where they agree best with all that are placed.

    Raises
    ------
    RegistrationError
        When fewer than two views agree with each other.
    """
    count = len(names)
    pairs = {(i, j): search.pair(i, j) for i in range(count) for j in range(i + 1, count)}
    reference = _best_reference(pairs, count)
    placed: dict[int, Array] = {reference: np.eye(4)}
    rejected: list[tuple[int, str]] = []
    waiting = [k for k in range(count) if k != reference]
    while waiting:
        options = [_best_place(search, pairs, placed, view) for view in waiting]
        order = int(np.argmin([o[0] for o in options]))
        view = waiting.pop(order)
        cost, pose, overlap = options[order]
        if cost > COST_LIMIT_MM or overlap < OVERLAP_LIMIT:
            rejected.append(
                (view, f"disagrees by {cost:.2f} mm (limit {COST_LIMIT_MM}), overlap {100 * overlap:.0f} %")
            )
        else:
            placed[view] = pose
    if len(placed) < 2:
        raise RegistrationError(
            "the views cannot be brought together: "
            + "; ".join(f"{names[k]} {why}" for k, why in rejected)
            + ". Views need to show the same part and table with at least a third in common."
        )
    poses = tuple(placed.get(k) for k in range(count))
    return ViewGraph(reference, poses, _cost_table(search, poses), tuple(rejected), pairs)


def _best_reference(pairs: dict[tuple[int, int], PairPose], count: int) -> int:
    """Return the view whose pairs are best: large overlap, small cost."""
    worth = np.zeros(count)
    for (i, j), p in pairs.items():
        value = p.overlap / (0.2 + min(p.cost_mm, 10.0))
        worth[i] += value
        worth[j] += value
    return int(np.argmax(worth))


def _best_place(
    search: PairSearch, pairs: dict[tuple[int, int], PairPose], placed: dict[int, Array], view: int
) -> tuple[float, Array, float]:
    """Return cost, pose and best overlap of the neighbour's proposal that all placed views like most."""
    best: tuple[float, Array, float] = (np.inf, np.eye(4), 0.0)
    for neighbour, T in placed.items():
        pair = pairs[min(view, neighbour), max(view, neighbour)]
        if not np.isfinite(pair.cost_mm):
            continue
        T_neighbour_view = pair.T_target_source if pair.target == neighbour else invert(pair.T_target_source)
        pose = T @ T_neighbour_view
        costs, overlaps = zip(*(search.cost(k, view, invert(P) @ pose) for k, P in placed.items()), strict=True)
        weight = np.maximum(np.array(overlaps) - 0.1, 1e-3)
        cost = float(np.average(costs, weights=weight))
        if cost < best[0]:
            best = (cost, pose, max(overlaps))
    return best


def _cost_table(search: PairSearch, poses: tuple[Array | None, ...]) -> Array:
    table = np.full((len(poses), len(poses)), np.nan)
    for i, Ti in enumerate(poses):
        for j, Tj in enumerate(poses):
            if i < j and Ti is not None and Tj is not None:
                table[i, j] = table[j, i] = search.cost(i, j, invert(Ti) @ Tj)[0]
    return table
