"""Closed rows moved a little so that a whole number of steps fits them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.planning.levels import Line

GOOD_OF_STEP = 0.025
MOVE_OF_PITCH = 0.045
# Round a pole the smallest row is a square: three points would leave its sides uncovered.
FEWEST, POLE_STEPS, POLE_MOVE_OF_PITCH = 4, 5, 0.25
PROBE_OF_PITCH = 0.02


def fitted_loops(
    lines: list[Line], lines_at: Callable[[Array], list[Line]], *, step_mm: float, pitch_mm: float
) -> list[Line]:
    """Return lines with each closed one at the nearby level where its steps fit best.

    Parameters
    ----------
    lines : list of Line
    lines_at : callable, levels (L,) ascending -> the lines there
    step_mm, pitch_mm : float
    """
    unfit = [k for k, line in enumerate(lines) if line.closed and _misfit(_length(line), step_mm)]
    if not unfit:
        return lines
    delta = PROBE_OF_PITCH * pitch_mm
    beside = lines_at(np.unique([lines[k].level + delta for k in unfit]))
    moves = {k: move for k in unfit if (move := _move(lines[k], beside, delta, step_mm, pitch_mm)) is not None}
    moved = lines_at(np.unique([lines[k].level + move for k, move in moves.items()])) if moves else []
    result = list(lines)
    for k, move in moves.items():
        partner = _partner(lines[k], moved, lines[k].level + move)
        if partner is not None and _error(_length(partner), step_mm) < _error(_length(lines[k]), step_mm):
            result[k] = partner
    return result


def steps_in_loop(length: float, step_mm: float) -> int:
    """Return into how many steps a closed row is divided."""
    return max(FEWEST, round(length / step_mm))


def _length(line: Line) -> float:
    return float(np.linalg.norm(np.diff(line.points, axis=0), axis=1).sum())


def _wanted(length: float, step_mm: float) -> float:
    """Return the length of a round loop whose chords are one step."""
    n = steps_in_loop(length, step_mm)
    return float(np.pi * step_mm / np.sin(np.pi / n))


def _error(length: float, step_mm: float) -> float:
    return abs(_wanted(length, step_mm) - length) / steps_in_loop(length, step_mm)


def _misfit(length: float, step_mm: float) -> bool:
    return _error(length, step_mm) > GOOD_OF_STEP * step_mm


def _move(line: Line, beside: list[Line], delta: float, step_mm: float, pitch_mm: float) -> float | None:
    partner = _partner(line, beside, line.level + delta)
    if partner is None:
        return None
    length = _length(line)
    slope = (_length(partner) - length) / delta
    if abs(slope) < 0.5:
        return None
    limit = (POLE_MOVE_OF_PITCH if length < POLE_STEPS * step_mm else MOVE_OF_PITCH) * pitch_mm
    # Only as far as it takes: rows that move open a gap on their other side.
    spare = 0.9 * GOOD_OF_STEP * step_mm * steps_in_loop(length, step_mm)
    change = _wanted(length, step_mm) - length
    change -= float(np.clip(change, -spare, spare))
    return float(np.clip(change / slope, -limit, limit))


def _partner(line: Line, others: list[Line], level: float) -> Line | None:
    near = [o for o in others if o.closed and abs(o.level - level) < 1e-9]
    if not near:
        return None
    centre = line.points.mean(axis=0)
    best = min(near, key=lambda o: float(np.linalg.norm(o.points.mean(axis=0) - centre)))
    return best if np.linalg.norm(best.points.mean(axis=0) - centre) < 0.5 * _length(line) else None
