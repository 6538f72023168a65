"""Level lines of a field on a mesh (marching triangles), clipped and in running order."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from eddyscan.core.frames import Array, IntArray
from eddyscan.planning.topology import Edges


@dataclass(frozen=True)
class Line:
    """A polyline on the mesh.

    Attributes
    ----------
    points : (N, 3) [mm]; a closed line repeats its first point at the end
    face : (N - 1,) the face each segment lies in
    level : float
    closed : bool
    guard : (N,) the clipping field at the points, positive inside
    """

    points: Array
    face: IntArray
    level: float
    closed: bool
    guard: Array


def level_lines(
    vertices: Array, faces: IntArray, edges: Edges, field: Array, levels: Array, guard: Array
) -> list[Line]:
    """Return the level lines of a vertex field, ordered by level.

    Parameters
    ----------
    vertices : (V, 3) [mm], faces : (F, 3), edges : Edges of the faces
    field : (V,), levels : (L,) ascending
    guard : (V,) interpolated along to the lines' points
    """
    value = _off_levels(field, levels)
    low = np.searchsorted(levels, value[edges.ends].min(axis=1))
    n_on_edge = np.searchsorted(levels, value[edges.ends].max(axis=1)) - low
    offset = np.concatenate([[0], np.cumsum(n_on_edge)])
    if offset[-1] == 0:
        return []
    edge = np.repeat(np.arange(len(edges.ends)), n_on_edge)
    level = low[edge] + np.arange(offset[-1]) - offset[edge]
    a, b = edges.ends[edge].T
    t = (levels[level] - value[a]) / (value[b] - value[a])
    points = vertices[a] + t[:, None] * (vertices[b] - vertices[a])
    guards = guard[a] + t * (guard[b] - guard[a])
    ends, face = _segments(value, faces, edges, levels, offset[:-1] - low)
    lines = []
    for chain, chain_faces, closed in _chains(ends, face, len(points)):
        lines.append(Line(points[chain], chain_faces, float(levels[level[chain[0]]]), closed, guards[chain]))
    return sorted(lines, key=lambda line: line.level)


def _off_levels(field: Array, levels: Array) -> Array:
    """Nudge values that meet a level exactly, so that every crossing is inside an edge."""
    step = 1e-9 * max(float(np.ptp(field)), 1e-12)
    nearest = levels[np.clip(np.searchsorted(levels, field), 0, len(levels) - 1)]
    before = levels[np.clip(np.searchsorted(levels, field) - 1, 0, len(levels) - 1)]
    hit = (np.abs(field - nearest) < step) | (np.abs(field - before) < step)
    return np.where(hit, field + 3 * step, field)


def _segments(value: Array, faces: IntArray, edges: Edges, levels: Array, shift: IntArray) -> tuple[IntArray, IntArray]:
    corner = value[faces]
    first = np.searchsorted(levels, corner.min(axis=1))
    n = np.searchsorted(levels, corner.max(axis=1)) - first
    face = np.repeat(np.arange(len(faces)), n)
    begin = np.concatenate([[0], np.cumsum(n)])
    level = first[face] + np.arange(begin[-1]) - begin[face]
    above = corner[face] > levels[level][:, None]
    crossed = above != np.roll(above, -1, axis=1)
    which = np.nonzero(crossed)[1].reshape(-1, 2)
    return shift[edges.of_face[face[:, None], which]] + level[:, None], face


def _chains(ends: IntArray, face: IntArray, n_nodes: int) -> list[tuple[IntArray, IntArray, bool]]:
    """Join segments into chains; open ones first, then loops."""
    flat = ends.ravel()
    order = np.argsort(flat, kind="stable")
    nodes, start = np.unique(flat[order], return_index=True)
    segment = order // 2
    first, second = np.full(n_nodes, -1), np.full(n_nodes, -1)
    first[nodes] = segment[start]
    count = np.diff(np.append(start, len(flat)))
    second[nodes[count > 1]] = segment[start[count > 1] + 1]
    free = nodes[count == 1]
    at = _Walk(first.tolist(), second.tolist(), ends.tolist())
    chains = [at.follow(int(node), closed=False) for node in free if not at.seen[int(first[node])]]
    chains += [at.follow(int(ends[s, 0]), closed=True) for s in range(len(ends)) if not at.seen[s]]
    return [(np.asarray(c), face[np.asarray(s)], closed) for c, s, closed in chains]


class _Walk:
    """Follows segments from node to node; plain lists because numpy scalars are slow here."""

    def __init__(self, first: list[int], second: list[int], ends: list[list[int]]) -> None:
        self.first, self.second, self.ends = first, second, ends
        self.seen = [False] * len(ends)

    def follow(self, node: int, *, closed: bool) -> tuple[list[int], list[int], bool]:
        nodes: list[int] = [node]
        segments: list[int] = []
        while True:
            segment = self.first[node]
            if segment < 0 or self.seen[segment]:
                segment = self.second[node]
                if segment < 0 or self.seen[segment]:
                    return nodes, segments, closed
            self.seen[segment] = True
            a, b = self.ends[segment]
            node = b if a == node else a
            nodes.append(node)
            segments.append(segment)


def clipped(line: Line) -> list[Line]:
    """Return the pieces of a line where its guard is positive; a loop cut once opens there."""
    inside = line.guard > 0
    if inside.all():
        return [line]
    if not inside.any():
        return []
    if line.closed:
        line = _opened(line, int(np.argmin(inside[:-1])))
        inside = line.guard > 0
    change = np.flatnonzero(inside[1:] != inside[:-1])
    bounds = np.concatenate([[-1], change, [len(inside) - 1]])
    pieces = []
    for lo, hi in pairwise(bounds.tolist()):
        if inside[hi]:
            pieces.append(_piece(line, lo, hi))
    return [piece for piece in pieces if len(piece.points) > 1]


def _opened(line: Line, at: int) -> Line:
    points = np.concatenate([line.points[at:-1], line.points[: at + 1]])
    guard = np.concatenate([line.guard[at:-1], line.guard[: at + 1]])
    return Line(points, np.concatenate([line.face[at:], line.face[:at]]), line.level, False, guard)


def _piece(line: Line, lo: int, hi: int) -> Line:
    """Cut out nodes lo+1..hi with the crossing points on both sides."""
    points, guard, face = [line.points[lo + 1 : hi + 1]], [line.guard[lo + 1 : hi + 1]], line.face[lo + 1 : hi]
    if lo >= 0:
        t = line.guard[lo] / (line.guard[lo] - line.guard[lo + 1])
        points.insert(0, line.points[lo : lo + 1] + t * (line.points[lo + 1] - line.points[lo]))
        guard.insert(0, np.zeros(1))
        face = np.concatenate([line.face[lo : lo + 1], face])
    if hi < len(line.points) - 1:
        t = line.guard[hi] / (line.guard[hi] - line.guard[hi + 1])
        points.append(line.points[hi : hi + 1] + t * (line.points[hi + 1] - line.points[hi]))
        guard.append(np.zeros(1))
        face = np.concatenate([face, line.face[hi : hi + 1]])
    return Line(np.concatenate(points), face, line.level, False, np.concatenate(guard))
