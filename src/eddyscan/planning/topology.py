"""Edges, borders and connected pieces of a triangle mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from eddyscan.core.frames import Array, IntArray


@dataclass(frozen=True)
class Edges:
    """Every undirected edge once.

    Attributes
    ----------
    ends : (E, 2) int64, smaller vertex first
    of_face : (F, 3) int64
        Edge k of a face joins its corners k and k + 1.
    count : (E,) int64
        How many faces share the edge: 1 border, 2 inside, more non-manifold.
    """

    ends: IntArray
    of_face: IntArray
    count: IntArray


def edges_of(faces: IntArray) -> Edges:
    """Return the undirected edges of a (F, 3) face list."""
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    low, high = directed.min(axis=1), directed.max(axis=1)
    span = int(faces.max()) + 1
    keys, inverse, count = np.unique(low * span + high, return_inverse=True, return_counts=True)
    ends = np.stack([keys // span, keys % span], axis=1)
    return Edges(ends, inverse.reshape(-1, 3), count)


def border_edges(faces: IntArray) -> IntArray:
    """Return the (B, 2) edges of only one face, directed as the face runs."""
    edges = edges_of(faces)
    directed = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)
    return np.asarray(directed[edges.count[edges.of_face] == 1])


def border_loops(faces: IntArray) -> list[IntArray]:
    """Return each border as its vertices in running order, longest (most vertices) first."""
    following: dict[int, list[int]] = {}
    for start, end in border_edges(faces).tolist():
        following.setdefault(start, []).append(end)
    loops = []
    while following:
        start = next(iter(following))
        loop, at = [start], _take(following, start)
        while at is not None and at != start:
            loop.append(at)
            at = _take(following, at)
        loops.append(np.asarray(loop, dtype=np.int64))
    return sorted(loops, key=len, reverse=True)


def _take(following: dict[int, list[int]], vertex: int) -> int | None:
    ends = following.get(vertex)
    if not ends:
        return None
    end = ends.pop()
    if not ends:
        del following[vertex]
    return end


def face_pieces(faces: IntArray, joined: Array | None = None) -> tuple[int, IntArray]:
    """Return the number of pieces connected over edges and each face's piece.

    Parameters
    ----------
    faces : (F, 3)
    joined : (E,) bool, optional
        Which of `edges_of(faces)` connect; all that are shared when left out.
    """
    edges = edges_of(faces)
    face = np.repeat(np.arange(len(faces)), 3)
    edge = edges.of_face.ravel()
    if joined is not None:
        keep = np.asarray(joined, dtype=bool)[edge]
        face, edge = face[keep], edge[keep]
    incidence = coo_matrix((np.ones(len(face)), (face, edge)), shape=(len(faces), len(edges.ends))).tocsr()
    n, label = connected_components(incidence @ incidence.T, directed=False)
    return int(n), label.astype(np.int64)


def compacted(vertices: Array, faces: IntArray) -> tuple[Array, IntArray, IntArray]:
    """Return vertices and faces without unused vertices, and the old number of each kept vertex."""
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3).astype(np.int64), used
