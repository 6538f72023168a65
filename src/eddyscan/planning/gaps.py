"""Short extra rows where spots are left between rows: beside holes, at ridges, at borders that rows leave."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from eddyscan.core.frames import Array
from eddyscan.planning.levels import Line
from eddyscan.planning.verify import Samples

# A spot this much of a pitch from every row asks for a row of its own.
WORTH_A_ROW = 0.55
SEEN_AS_GAP = 0.51
MOST_ROWS = 200


@dataclass(frozen=True)
class Gap:
    """Spots left out together: points (K, 3) [mm], the field's value there, the largest distance to a row."""

    points: Array
    level: float
    distance_mm: float


def gaps_between(samples: Samples, distance_mm: Array, field: Array, pitch_mm: float) -> list[Gap]:
    """Return the gaps worth a row, widest first.

    Parameters
    ----------
    samples : Samples of the region
    distance_mm : (N,) of each sample to the nearest row
    field : (N,) the rows' field at the samples
    """
    out = np.flatnonzero(distance_mm > SEEN_AS_GAP * pitch_mm)
    if out.size == 0 or distance_mm.max() < WORTH_A_ROW * pitch_mm:
        return []
    points = samples.points[out]
    pairs = KDTree(points).query_pairs(0.35 * pitch_mm, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(out), len(out)))
    n, label = connected_components(graph, directed=False)
    gaps = []
    for k in range(n):
        own = out[label == k]
        widest = float(distance_mm[own].max())
        if widest >= WORTH_A_ROW * pitch_mm:
            level = float((field[own].min() + field[own].max()) / 2)
            gaps.append(Gap(samples.points[own], level, widest))
    return sorted(gaps, key=lambda gap: -gap.distance_mm)[:MOST_ROWS]


def line_through(gap: Gap, lines_at: Callable[[Array], list[Line]], step_mm: float) -> Line | None:
    """Return the piece of the level line through a gap that spans it, a whole number of steps long where it fits."""
    lines = lines_at(np.array([gap.level]))
    if not lines:
        return None
    tree = KDTree(gap.points)
    line = min(lines, key=lambda candidate: float(np.min(tree.query(candidate.points)[0])))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line.points, axis=0), axis=1))])
    at = s[KDTree(line.points).query(gap.points)[1]]
    if line.closed and np.ptp(at) > 0.5 * s[-1]:
        return line
    length = step_mm * max(1.0, np.ceil(np.ptp(at) / step_mm))
    low = float(np.clip((at.min() + at.max() - length) / 2, 0.0, max(s[-1] - length, 0.0)))
    return window(line, s, low, min(low + length, float(s[-1])))


def window(line: Line, s: Array, low: float, high: float) -> Line | None:
    """Return the part of a line between two arc lengths."""
    inner = np.flatnonzero((s > low + 1e-9) & (s < high - 1e-9))
    ends = np.array([low, high])
    cut = np.stack([np.interp(ends, s, line.points[:, k]) for k in range(3)], axis=1)
    if high - low < 1e-6:
        return None
    first = int(np.searchsorted(s, low + 1e-9, side="right")) - 1
    last = int(np.searchsorted(s, high - 1e-9, side="left")) - 1
    points = np.concatenate([cut[:1], line.points[inner], cut[1:]])
    return Line(points, line.face[first : last + 1], line.level, False, np.ones(len(points)))
