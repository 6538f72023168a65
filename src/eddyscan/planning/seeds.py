"""Where rows may start from: a curve through the middle, a round border, the end of a tube, a pole."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, IntArray
from eddyscan.planning.fields import Seed
from eddyscan.planning.holes import Filled
from eddyscan.planning.levels import level_lines
from eddyscan.planning.smooth import tangents_of
from eddyscan.planning.topology import Edges
from eddyscan.planning.trace import Rays

CORNER_DEG = 35.0
CORNER_REACH_MM = 2.5
CLUSTER_REACHES = 3
ROUND_ENOUGH = 1.6
RAY_SPACING = 0.75
POLE_RAYS = 360


def seeds_for(mesh: Filled, edges: Edges) -> Iterator[Seed]:
    """Yield seeds to lay rows from, the most promising first."""
    smooth = [loop for loop in mesh.outer if not has_corners(mesh.vertices, loop)]
    if not mesh.outer:
        yield pole_seed(mesh)
    elif len(smooth) == len(mesh.outer) and (len(mesh.outer) > 1 or _aspect(mesh) < ROUND_ENOUGH):
        yield border_seed(mesh, smooth[0])
    for f in chain(_between_sides(mesh), _planes(mesh)):
        seed = middle_seed(mesh, edges, f)
        if seed is not None:
            yield seed


def middle_seed(mesh: Filled, edges: Edges, f: Array) -> Seed | None:
    """Return the zero line of a vertex field (V',) as the seed, or None when there is none."""
    lines = level_lines(mesh.vertices, mesh.faces, edges, f, np.zeros(1), np.ones(len(f)))
    if not lines:
        return None
    corner = f[mesh.faces]
    # Where the line meets vertices, faces on both sides count, whichever way rounding falls.
    near = 1e-6 * mesh.edge_mm
    crossed = (corner.min(axis=1) <= near) & (corner.max(axis=1) >= -near)
    vertex = np.unique(mesh.faces[crossed])
    side = np.where(f > 0, 1.0, -1.0)
    polylines = [evened(line.points, mesh.edge_mm, closed=line.closed) for line in lines]
    start, along = (np.concatenate(part) for part in zip(*(_tangents(p, closed=c) for p, c in polylines), strict=True))
    up = _normals_near(mesh, start)
    rays = [Rays(start, way * np.cross(up, along), sign) for way, sign in _sides(mesh, f, start, np.cross(up, along))]
    distance = side[vertex] * _to_lines(mesh.vertices[vertex], [p for p, _ in polylines])
    return Seed(vertex, distance, side, rays)


def border_seed(mesh: Filled, loop: IntArray) -> Seed:
    """Return a whole border as the seed."""
    points = mesh.vertices[np.append(loop, loop[0])]
    start, along = _tangents(evened(points, mesh.edge_mm, closed=True)[0], closed=True)
    # A border runs with its faces on the left.
    rays = [Rays(start, np.cross(_normals_near(mesh, start), along), 1.0)]
    return Seed(loop, np.zeros(len(loop)), np.ones(len(mesh.vertices)), rays)


def pole_seed(mesh: Filled) -> Seed:
    """Return the vertex furthest along the body's longest axis and its neighbours as the seed."""
    used = np.unique(mesh.faces)
    d = mesh.vertices[used] - mesh.vertices[used].mean(axis=0)
    axis = np.linalg.svd(d, full_matrices=False)[2][0]
    pole = used[int(np.argmax(d @ axis))]
    ring = np.unique(mesh.faces[(mesh.faces == pole).any(axis=1)])
    u, v = tangents_of(mesh.normals[pole][None])[0]
    angle = np.linspace(0, 2 * np.pi, POLE_RAYS, endpoint=False)[:, None]
    rays = [Rays(np.repeat(mesh.vertices[pole][None], POLE_RAYS, axis=0), np.cos(angle) * u + np.sin(angle) * v, 1.0)]
    distance = np.linalg.norm(mesh.vertices[ring] - mesh.vertices[pole], axis=1)
    return Seed(ring, distance, np.ones(len(mesh.vertices)), rays)


def evened(points: Array, step_mm: float, *, closed: bool) -> tuple[Array, bool]:
    """Return a polyline at even steps, its zigzag of less than a few steps smoothed away; closed ones keep wrapping."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    n = max(4, int(np.ceil(s[-1] / (RAY_SPACING * step_mm))))
    at = np.linspace(0, s[-1], n + 1)
    even = np.stack([np.interp(at, s, points[:, k]) for k in range(3)], axis=1)
    if closed:
        even = even[:-1]
    # Reflecting odd about the ends keeps straight ends straight.
    margin = min(8, len(even) - 1)
    if closed:
        padded = np.concatenate([even[-margin:], even, even[:margin]])
    else:
        padded = np.concatenate([2 * even[0] - even[margin:0:-1], even, 2 * even[-1] - even[-2 : -margin - 2 : -1]])
    smooth = gaussian_filter1d(padded, 2.0, axis=0)[margin : margin + len(even)]
    # Two passes forward and one back keep a curve from shrinking (Taubin 1995).
    lost = gaussian_filter1d(padded - gaussian_filter1d(padded, 2.0, axis=0), 2.0, axis=0)[margin : margin + len(even)]
    return smooth + lost, closed


def _tangents(points: Array, *, closed: bool) -> tuple[Array, Array]:
    around = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along = around if closed else np.gradient(points, axis=0)
    return points, along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)


def _normals_near(mesh: Filled, points: Array) -> Array:
    near, index = KDTree(mesh.vertices).query(points, k=3)
    weight = 1 / (np.asarray(near) ** 2 + 1e-4)
    normal = np.einsum("nk,nkj->nj", weight, mesh.normals[np.asarray(index)])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12))


def _sides(mesh: Filled, f: Array, start: Array, across: Array) -> list[tuple[Array, float]]:
    """Return, for both signs of the field, which way (K, 1) the rays leave the seed."""
    tree = KDTree(mesh.vertices)
    ahead = f[tree.query(start + 2 * mesh.edge_mm * across)[1]] - f[tree.query(start - 2 * mesh.edge_mm * across)[1]]
    way = np.where(ahead > 0, 1.0, -1.0)[:, None]
    return [(way, 1.0), (-way, -1.0)]


def has_corners(vertices: Array, loop: IntArray) -> bool:
    """Tell whether a border turns sharply anywhere, seen over a few mm to either side."""
    return bool((_turns_deg(vertices, loop) > CORNER_DEG).any())


def _turns_deg(vertices: Array, loop: IntArray) -> Array:
    """Return how much more (n,) [deg] a border turns at each vertex than a round one would."""
    points = vertices[loop]
    step = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
    s, total = np.concatenate([[0.0], np.cumsum(step)[:-1]]), float(step.sum())
    reach = max(CORNER_REACH_MM, 2.0 * float(np.median(step)))
    if total < 12 * reach:
        return np.full(len(loop), 180.0)
    x = np.concatenate([s, [total]])
    closed = np.concatenate([points, points[:1]])

    def at(where: Array) -> Array:
        return np.stack([np.interp(where % total, x, closed[:, k]) for k in range(3)], axis=1)

    before, after = points - at(s - reach), at(s + reach) - points
    cosine = np.einsum("nk,nk->n", before, after)
    cosine /= np.maximum(np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1), 1e-12)
    # A round border of this length turns by 2 pi reach / total over the reach.
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))) - 360 * reach / total)


def _between_sides(mesh: Filled) -> Iterator[Array]:
    """Yield, for a border with four corners, how much nearer (V',) one side is than its opposite: long sides first."""
    if len(mesh.outer) != 1:
        return
    loop = mesh.outer[0]
    corner = _peaks(_turns_deg(mesh.vertices, loop), mesh.vertices[loop])
    if len(corner) != 4:
        return
    loop, corner = np.roll(loop, -corner[0]), corner - corner[0]
    ends = [*corner.tolist(), len(loop)]
    sides = [mesh.vertices[np.take(loop, np.arange(a, b + 1), mode="wrap")] for a, b in pairwise(ends)]
    length = [float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum()) for side in sides]
    pairs = [(0, 2), (1, 3)] if length[0] + length[2] >= length[1] + length[3] else [(1, 3), (0, 2)]
    for a, b in pairs:
        yield _to_lines(mesh.vertices, [sides[a]]) - _to_lines(mesh.vertices, [sides[b]])


def _peaks(turn_deg: Array, points: Array) -> IntArray:
    """Return the sharpest vertex (K,) of each corner in running order."""
    left = np.where(turn_deg > CORNER_DEG, turn_deg, 0.0)
    before, after = points - np.roll(points, 1, axis=0), np.roll(points, -1, axis=0) - points
    # Over a few mm a corner is seen from its neighbours too; the turn at the vertex itself tells which it is.
    own = -np.einsum("nk,nk->n", before, after) / np.maximum(
        np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1), 1e-12
    )
    found = []
    while left.max() > 0:
        near = np.linalg.norm(points - points[int(np.argmax(left))], axis=1) < CLUSTER_REACHES * CORNER_REACH_MM
        candidates = np.flatnonzero(near & (left > 0))
        best = int(candidates[np.argmax(np.round(own[candidates], 6))])
        found.append(best)
        near |= np.linalg.norm(points - points[best], axis=1) < CLUSTER_REACHES * CORNER_REACH_MM
        left[near] = 0.0
    return np.sort(np.asarray(found, dtype=np.int64))


def _planes(mesh: Filled) -> Iterator[Array]:
    middle = mesh.vertices[np.unique(mesh.faces)].mean(axis=0)
    for direction in _directions(mesh):
        yield (mesh.vertices - middle) @ direction


def _directions(mesh: Filled) -> list[Array]:
    """Return the normals of planes through the middle, those that need the fewest rows first."""
    used = np.unique(mesh.faces[: mesh.n_faces])
    points = mesh.vertices[used] - mesh.vertices[used].mean(axis=0)
    up = mesh.normals[used].mean(axis=0)
    if np.linalg.norm(up) < 0.2:
        return list(np.linalg.svd(points, full_matrices=False)[2])
    up /= np.linalg.norm(up)
    x = np.array([1.0, 0.0, 0.0]) - up[0] * up
    if np.linalg.norm(x) < 0.1:
        x = np.array([0.0, 1.0, 0.0]) - up[1] * up
    x /= np.linalg.norm(x)
    y = np.cross(up, x)
    angle = np.radians(np.arange(0, 180, 5))
    ways = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    width = np.ptp(points @ ways.T, axis=0)
    best = int(np.argmin(np.round(width, 3)))
    return [ways[best], ways[(best + len(ways) // 2) % len(ways)]]


def _aspect(mesh: Filled) -> float:
    points = mesh.vertices[np.unique(mesh.faces[: mesh.n_faces])]
    ways = _directions(mesh)[:2]
    spans = [float(np.ptp(points @ way)) for way in ways]
    return max(spans) / max(min(spans), 1e-9)


def _to_lines(points: Array, lines: list[Array]) -> Array:
    """Return the distance (N,) of points near polylines."""
    start = np.concatenate([line[:-1] for line in lines])
    end = np.concatenate([line[1:] for line in lines])
    _, near = KDTree((start + end) / 2).query(points, k=min(6, len(start)))
    near = np.asarray(near).reshape(len(points), -1)
    a, d = start[near], (end - start)[near]
    t = np.einsum("nkj,nkj->nk", points[:, None] - a, d) / np.maximum(np.einsum("nkj,nkj->nk", d, d), 1e-12)
    foot = a + np.clip(t, 0, 1)[..., None] * d
    return np.asarray(np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1))
