"""In which order strokes are run, and which way: the shortest links found.

Rows in their own order, turned to and fro, are hard to beat where nothing
interrupts them. Behind holes they are not: then the nearest end is taken
first and the tour is improved by turning stretches round (2-opt) and moving
single strokes, both with either direction of every stroke allowed.
"""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.planning.strokes import Stroke

MOST_TO_IMPROVE = 250
ROUNDS_PER_STROKE = 3
LEAST_GAIN_MM = 1e-6


def ordered(strokes: list[Stroke], start: Array | None = None) -> list[Stroke]:
    """Return every stroke once, some reversed or begun elsewhere, for short links.

    Parameters
    ----------
    strokes : list of Stroke, rows in their own order
    start : (3,) [mm], where the probe comes from
    """
    if len(strokes) < 2:
        return _turned(strokes, start)
    to_and_fro = _turned(strokes, start)
    nearest = _nearest_first(strokes, start)
    if len(strokes) <= MOST_TO_IMPROVE:
        nearest = _improved(nearest, start)
    nearest = _turned(nearest, start)
    return nearest if links_mm(nearest, start) < links_mm(to_and_fro, start) - LEAST_GAIN_MM else to_and_fro


def links_mm(strokes: list[Stroke], start: Array | None = None) -> float:
    """Return the summed straight distance [mm] from each stroke's end to the next one's start."""
    ends = [stroke.points[-1] for stroke in strokes]
    before = ends[:-1] if start is None else [start, *ends[:-1]]
    firsts = [stroke.points[0] for stroke in (strokes[1:] if start is None else strokes)]
    return float(sum(np.linalg.norm(a - b) for a, b in zip(before, firsts, strict=True)))


def _turned(strokes: list[Stroke], start: Array | None) -> list[Stroke]:
    """Return strokes in the given order, each turned so that it begins near the end before it."""
    run: list[Stroke] = []
    at = start
    for stroke in strokes:
        if at is not None:
            stroke = _begun_near(stroke, at) if stroke.closed else _nearer_end_first(stroke, at)
        run.append(stroke)
        at = stroke.points[-1]
    return run


def _nearer_end_first(stroke: Stroke, at: Array) -> Stroke:
    ahead, back = np.linalg.norm(stroke.points[0] - at), np.linalg.norm(stroke.points[-1] - at)
    return stroke.reversed() if back < ahead else stroke


def _begun_near(stroke: Stroke, at: Array) -> Stroke:
    """Return a closed stroke that begins at its reading nearest to `at`."""
    k = int(np.argmin(np.linalg.norm(stroke.points[:-1] - at, axis=1)))
    if k == 0:
        return stroke
    points, normals = (np.concatenate([rows[k:-1], rows[: k + 1]]) for rows in (stroke.points, stroke.normals))
    return Stroke(points, normals, stroke.s_mm, stroke.level, closed=True)


def _nearest_first(strokes: list[Stroke], start: Array | None) -> list[Stroke]:
    ends = np.stack([[stroke.points[0], stroke.points[-1]] for stroke in strokes])
    left = np.ones(len(strokes), dtype=bool)
    at = ends[0, 0] if start is None else start
    run = []
    for _ in strokes:
        distance = np.where(left[:, None], np.linalg.norm(ends - at, axis=2), np.inf)
        k, end = np.unravel_index(int(np.argmin(distance)), distance.shape)
        left[k] = False
        run.append(strokes[k].reversed() if end else strokes[k])
        at = ends[k, 1 - end]
    return run


def _improved(strokes: list[Stroke], start: Array | None) -> list[Stroke]:
    n = len(strokes)
    first = np.stack([stroke.points[0] for stroke in strokes])
    last = np.stack([stroke.points[-1] for stroke in strokes])
    order, turned = np.arange(n), np.zeros(n, dtype=bool)
    for _ in range(ROUNDS_PER_STROKE * n):
        enter = np.where(turned[order, None], last[order], first[order])
        leave = np.where(turned[order, None], first[order], last[order])
        gain, i, j = _best_turn(enter, leave, start)
        moved, k, to, flip = _best_move(enter, leave, start)
        if max(gain, moved) < LEAST_GAIN_MM:
            break
        if gain >= moved:
            order[i : j + 1] = order[i : j + 1][::-1].copy()
            turned[order[i : j + 1]] ^= True
        else:
            stroke = order[k]
            turned[stroke] ^= flip
            order = np.insert(np.delete(order, k), to, stroke)
    return [strokes[k].reversed() if turned[k] else strokes[k] for k in order]


def _between(a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(a[:, None] - b[None], axis=2))


def _best_turn(enter: Array, leave: Array, start: Array | None) -> tuple[float, int, int]:
    """Return the gain and ends i..j of the stretch whose turning round shortens the links most."""
    n = len(enter)
    before = np.concatenate([[enter[0] if start is None else start], leave[:-1]])
    now_in = np.linalg.norm(before - enter, axis=1)
    now_in[0] = 0.0 if start is None else now_in[0]
    now_out = np.append(np.linalg.norm(leave[:-1] - enter[1:], axis=1), 0.0)
    new_in = _between(before, leave)
    if start is None:
        new_in[0] = 0.0
    new_out = np.concatenate([_between(enter, enter[1:]), np.zeros((n, 1))], axis=1)
    gain = now_in[:, None] + now_out[None] - new_in - new_out
    gain[np.tril_indices(n, -1)] = -np.inf
    i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
    return float(gain[i, j]), int(i), int(j)


def _best_move(enter: Array, leave: Array, start: Array | None) -> tuple[float, int, int, bool]:
    """Return the gain, the stroke's place, its new place once taken out, and whether it turns round."""
    n = len(enter)
    origin = enter[0] if start is None else start
    before, after = np.concatenate([[origin], leave[:-1]]), np.concatenate([enter[1:], leave[-1:]])
    link_in, link_out = np.linalg.norm(before - enter, axis=1), np.linalg.norm(leave - after, axis=1)
    skip = np.linalg.norm(before - after, axis=1)
    link_out[-1] = skip[-1] = 0.0
    if start is None:
        link_in[0] = skip[0] = 0.0
    taken = link_in + link_out - skip
    best = (0.0, 0, 0, False)
    for flip in (False, True):
        new_enter, new_leave = (leave, enter) if flip else (enter, leave)
        # Between places m - 1 and m, for m from 1 to n - 1.
        gap = np.linalg.norm(leave[:-1] - enter[1:], axis=1)
        cost = _between(new_enter, leave[:-1]) + _between(new_leave, enter[1:]) - gap
        gain = taken[:, None] - cost
        beside = np.arange(n - 1)
        gain[beside, beside] = gain[beside + 1, beside] = -np.inf
        k, m = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if gain[k, m] > best[0]:
            place = int(m) + 1 - (1 if k < m + 1 else 0)
            best = (float(gain[k, m]), int(k), place, flip)
    return best
