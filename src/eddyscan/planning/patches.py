"""The surface split at creases into patches that rows can run across."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.mesh import face_vectors
from eddyscan.planning.refine import refined
from eddyscan.planning.topology import compacted, edges_of, face_pieces

CREASE_DEG = 50.0
MERGE_ROUNDS = 6


@dataclass(frozen=True)
class Patch:
    """One connected piece to scan: vertices (V, 3) [mm, part], faces (F, 3)."""

    vertices: Array
    faces: IntArray

    @property
    def area_mm2(self) -> float:
        """Return the area [mm^2]."""
        return float(0.5 * np.linalg.norm(face_vectors(self.vertices, self.faces), axis=1).sum())

    def refined(self, longest_mm: float) -> tuple[Patch, int]:
        """Return the patch without edges longer than asked, and how many were split."""
        vertices, faces, split = refined(self.vertices, self.faces, longest_mm)
        return Patch(vertices, faces), split


def patches_of(vertices: Array, faces: IntArray, seen: BoolArray, *, least_mm2: float) -> list[Patch]:
    """Return the patches of the seen faces (F,), largest first; smaller ones than `least_mm2` are left out."""
    own = faces[seen]
    if len(own) == 0:
        return []
    label = _labels(vertices, own, least_mm2)
    pieces = [Patch(*compacted(vertices, own[label == k])[:2]) for k in np.unique(label)]
    return sorted((p for p in pieces if p.area_mm2 >= least_mm2), key=lambda p: -p.area_mm2)


def _labels(vertices: Array, faces: IntArray, least_mm2: float) -> IntArray:
    """Return each face's patch (F,); bits that noise cut off go back to the neighbour they share most edges with."""
    edges = edges_of(faces)
    flat = face_vectors(vertices, faces)
    area = 0.5 * np.linalg.norm(flat, axis=1)
    unit = flat / np.maximum(2 * area, 1e-300)[:, None]
    order = np.argsort(edges.of_face.ravel(), kind="stable")
    paired = edges.count[edges.of_face.ravel()[order]] == 2
    a, b = order[paired][0::2] // 3, order[paired][1::2] // 3
    edge = edges.of_face.ravel()[order[paired][0::2]]
    smooth = np.einsum("ek,ek->e", unit[a], unit[b]) > np.cos(np.radians(CREASE_DEG))
    joined = np.zeros(len(edges.ends), dtype=bool)
    joined[edge[smooth]] = True
    n, label = face_pieces(faces, joined)
    for _ in range(MERGE_ROUNDS):
        size = np.bincount(label, area, minlength=n)
        small = size < least_mm2
        across = label[a] != label[b]
        loose = across & (small[label[a]] | small[label[b]])
        if n == 1 or not loose.any():
            break
        label = _merged(label, label[a[loose]], label[b[loose]], size.astype(np.float64))
    return label


def _merged(label: IntArray, a: IntArray, b: IntArray, size: Array) -> IntArray:
    """Give each small piece the label of its larger neighbour with the most common edges."""
    small, large = np.where(size[a] < size[b], a, b), np.where(size[a] < size[b], b, a)
    pair, count = np.unique(np.stack([small, large], axis=1), axis=0, return_counts=True)
    best = pair[np.argsort(count, kind="stable")]
    into = np.arange(len(size))
    into[best[:, 0]] = best[:, 1]
    return into[label]
