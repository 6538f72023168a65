"""A mesh made fit to plan on: repairs are named, what cannot be repaired is refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh, face_vectors
from eddyscan.core.technique import Plan
from eddyscan.planning.topology import compacted, edges_of, face_pieces

SMALLEST_MM, LARGEST_MM = 2.0, 50_000.0
CRUMB_OF_PART = 0.002
WELD_OF_SIZE = 1e-7


@dataclass(frozen=True)
class Conditioned:
    """A mesh fit to plan on.

    Attributes
    ----------
    vertices : (V, 3) [mm], faces : (F, 3), consistently outward
    spacing_mm : float
        Typical distance of the vertices.
    notes : list of str, repairs in words
    crumbs_mm2 : float, area of loose pieces left out
    """

    vertices: Array
    faces: IntArray
    spacing_mm: float
    notes: list[str]
    crumbs_mm2: float


def conditioned(mesh: SurfaceMesh, settings: Plan) -> Conditioned:
    """Repair a mesh, or refuse it.

    Raises
    ------
    GeometryError
        When the size cannot be millimetres, the pitch or step exceeds the part,
        or nothing with area is left.
    """
    _check_size(mesh, settings)
    notes: list[str] = []
    vertices, faces = _welded(mesh.vertices, mesh.faces, notes)
    faces = _with_area(vertices, faces, notes)
    vertices, faces, crumbs_mm2 = _without_crumbs(vertices, faces, notes)
    faces = _outward(vertices, _consistent(faces, notes), notes)
    area = 0.5 * float(np.linalg.norm(face_vectors(vertices, faces), axis=1).sum())
    spacing = float(np.sqrt(area / len(vertices)))
    return Conditioned(vertices, faces, spacing, notes, crumbs_mm2)


def _check_size(mesh: SurfaceMesh, settings: Plan) -> None:
    used = mesh.vertices[np.unique(mesh.faces)]
    size = float(np.ptp(used, axis=0).max())
    if size < SMALLEST_MM:
        raise GeometryError(
            f"the mesh is {size:.3g} mm long (least is {SMALLEST_MM:g} mm): probably metres. Multiply it by 1000."
        )
    if size > LARGEST_MM:
        raise GeometryError(
            f"the mesh is {size:.3g} mm long (most is {LARGEST_MM:g} mm): probably micrometres. Divide it by 1000."
        )
    for name in ("pitch_mm", "step_mm"):
        value = getattr(settings, name)
        if value > size:
            raise GeometryError(f"{name} {value:g} exceeds the part, which is {size:.1f} mm long. Lower {name}.")
    if size / settings.pitch_mm > 50_000:
        raise GeometryError(
            f"pitch_mm {settings.pitch_mm:g} on a part {size:.0f} mm long makes over 50000 rows. Raise pitch_mm."
        )


def _welded(vertices: Array, faces: IntArray, notes: list[str]) -> tuple[Array, IntArray]:
    """Join vertices at the same place, as a triangle soup (STL) has them."""
    grain = max(float(np.ptp(vertices, axis=0).max()) * WELD_OF_SIZE, 1e-9)
    keys = np.round((vertices - vertices.min(axis=0)) / grain).astype(np.int64)
    order = np.lexsort(keys.T)
    new = np.append(True, (np.diff(keys[order], axis=0) != 0).any(axis=1))
    if new.all():
        return vertices, faces
    number = np.empty(len(vertices), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    notes.append(f"{len(vertices) - int(new.sum())} doubled vertices joined")
    return vertices[order[new]], number[faces]


def _with_area(vertices: Array, faces: IntArray, notes: list[str]) -> IntArray:
    a, b, c = faces.T
    twice = np.linalg.norm(face_vectors(vertices, faces), axis=1)
    longest = np.max([np.linalg.norm(vertices[i] - vertices[j], axis=1) for i, j in ((a, b), (b, c), (c, a))], axis=0)
    good = (a != b) & (b != c) & (c != a) & (twice > 1e-6 * longest**2) & (longest > 0)
    low, middle, high = np.sort(faces, axis=1).T
    # Two keys of two vertices each: one sort of numbers instead of one of rows.
    order = np.lexsort((low * (len(vertices) + 1) + middle, high))
    same = (np.diff(high[order]) == 0) & (np.diff(middle[order]) == 0) & (np.diff(low[order]) == 0)
    first = order[np.append(True, ~same)]
    single = np.zeros(len(faces), dtype=bool)
    single[first] = True
    for bad, what in ((~good, "without area"), (good & ~single, "given twice")):
        if bad.any():
            notes.append(f"{int(bad.sum())} faces {what} left out")
    if not (good & single).any():
        raise GeometryError(f"none of the mesh's {len(faces)} faces has an area. Export it again.")
    return np.asarray(faces[good & single])


def _without_crumbs(vertices: Array, faces: IntArray, notes: list[str]) -> tuple[Array, IntArray, float]:
    n, label = face_pieces(faces)
    area = np.bincount(label, 0.5 * np.linalg.norm(face_vectors(vertices, faces), axis=1), minlength=n)
    crumb = area < CRUMB_OF_PART * area.sum()
    if n == 1 or not crumb.any() or crumb.all():
        return (*compacted(vertices, faces)[:2], 0.0)
    lost = float(area[crumb].sum())
    notes.append(f"{int(crumb.sum())} loose pieces of together {lost:.1f} mm^2 left out")
    return (*compacted(vertices, faces[~crumb[label]])[:2], lost)


def _consistent(faces: IntArray, notes: list[str]) -> IntArray:
    """Turn faces so that neighbours run their common edge in opposite ways."""
    edges = edges_of(faces)
    if (edges.count > 2).any():
        notes.append(f"{int((edges.count > 2).sum())} edges shared by more than two faces: the surface is cut there")
    forward = faces < np.roll(faces, -1, axis=1)
    shared = np.flatnonzero(edges.count == 2)
    order = np.argsort(edges.of_face.ravel(), kind="stable")
    order = order[np.isin(edges.of_face.ravel()[order], shared)] if len(shared) < len(edges.ends) else order
    first, second = order[0::2], order[1::2]
    clash = forward.ravel()[first] == forward.ravel()[second]
    if not clash.any():
        return faces
    turn = _parity(len(faces), first // 3, second // 3, clash)
    notes.append(f"{int(turn.sum())} faces turned to agree with their neighbours")
    return np.asarray(np.where(turn[:, None], faces[:, ::-1], faces))


def _parity(n: int, a: IntArray, b: IntArray, differs: Array) -> Array:
    """Return which faces to turn: along a tree from each piece's first face, the smaller share of each piece."""
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)).tocsr()
    pieces, label = connected_components(graph, directed=False)
    clash = coo_matrix((differs.astype(float), (a, b)), shape=(n, n)).tocsr()
    clash = (clash + clash.T).tocsr()
    turn = np.zeros(n, dtype=bool)
    for piece in range(pieces):
        root = int(np.argmax(label == piece))
        order, parent = breadth_first_order(graph, root, directed=False)
        odd = np.asarray(clash[order[1:], parent[order[1:]]]).ravel() > 0
        for face, before, change in zip(order[1:].tolist(), parent[order[1:]].tolist(), odd.tolist(), strict=True):
            turn[face] = turn[before] ^ change
        own = label == piece
        if turn[own].mean() > 0.5:
            turn[own] = ~turn[own]
    return turn


def _outward(vertices: Array, faces: IntArray, notes: list[str]) -> IntArray:
    """Turn pieces that look inwards (closed ones and tubes) or down (open ones)."""
    n, label = face_pieces(faces)
    flat = face_vectors(vertices, faces)
    centre = vertices[faces].mean(axis=1)
    edges = edges_of(faces)
    open_piece = np.zeros(n, dtype=bool)
    open_piece[np.unique(label[(edges.count[edges.of_face] == 1).any(axis=1)])] = True
    turned = 0
    for piece in range(n):
        own = label == piece
        mean = flat[own].sum(axis=0) / np.linalg.norm(flat[own], axis=1).sum()
        out = float(np.einsum("fk,fk->", centre[own] - centre[own].mean(axis=0), flat[own]))
        looks_up = abs(mean[2]) > 0.2 and open_piece[piece]
        if (mean[2] if looks_up else out) < 0:
            faces = np.where(own[:, None], faces[:, ::-1], faces)
            turned += 1
    if turned:
        notes.append(f"{turned} of {n} pieces looked inwards or down and were turned over")
    return faces
