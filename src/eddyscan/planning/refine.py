"""Long edges split, so that rows can bend between vertices."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array, IntArray
from eddyscan.planning.topology import edges_of

MOST_FACES = 600_000
ROUNDS = 16


def refined(vertices: Array, faces: IntArray, longest_mm: float) -> tuple[Array, IntArray, int]:
    """Return a mesh without edges over `longest_mm` (or as far as 600 000 faces go) and how many were split.

    All long edges are halved at once and every face is divided by how many of
    its edges were, so the mesh stays without gaps.
    """
    area = 0.5 * np.linalg.norm(
        np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]), axis=1
    )
    limit = max(longest_mm, float(np.sqrt(8 * area.sum() / MOST_FACES)))
    total = 0
    for _ in range(ROUNDS):
        edges = edges_of(faces)
        length = np.linalg.norm(vertices[edges.ends[:, 1]] - vertices[edges.ends[:, 0]], axis=1)
        # Halving edges just over the limit would make them needlessly short.
        split = length > 1.5 * limit
        if not split.any() or len(faces) > MOST_FACES:
            break
        total += int(split.sum())
        number = np.where(split, len(vertices) + np.cumsum(split) - 1, -1)
        middle = vertices[edges.ends[split]].mean(axis=1)
        vertices = np.concatenate([vertices, middle])
        faces = _divided(faces, number[edges.of_face], vertices)
    return vertices, faces, total


def _divided(faces: IntArray, middle: IntArray, vertices: Array) -> IntArray:
    """Divide faces (F, 3) by the middles (F, 3) of their edges, -1 where an edge stays."""
    n = (middle >= 0).sum(axis=1)
    # Turn each face so that a single split edge, or the single whole one, comes first.
    lead = np.where(n == 1, np.argmax(middle >= 0, axis=1), np.argmax(middle < 0, axis=1))
    turn = (lead[:, None] + np.arange(3)) % 3
    f, m = np.take_along_axis(faces, turn, axis=1), np.take_along_axis(middle, turn, axis=1)
    a, b, c = f.T
    p, q, r = m.T
    parts = [faces[n == 0]]
    one, two, three = n == 1, n == 2, n == 3
    parts += [_triangles(one, (a, p, c)), _triangles(one, (p, b, c))]
    parts += [_triangles(two, (q, c, r))]
    # The four-sided rest is cut along its shorter diagonal.
    short = np.linalg.norm(vertices[a] - vertices[q], axis=1) < np.linalg.norm(vertices[b] - vertices[r], axis=1)
    parts += [_triangles(two & short, (a, b, q)), _triangles(two & short, (a, q, r))]
    parts += [_triangles(two & ~short, (a, b, r)), _triangles(two & ~short, (b, q, r))]
    parts += [_triangles(three, corners) for corners in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))]
    return np.concatenate(parts)


def _triangles(which: Array, corners: tuple[IntArray, IntArray, IntArray]) -> IntArray:
    return np.stack([corner[which] for corner in corners], axis=1)
