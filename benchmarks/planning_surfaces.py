"""Exact surfaces and 1 mm meshes on them: what the planner's plans are measured against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay

from eddyscan.core.frames import Array, IntArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part

HOLE_CENTRE_MM = (100.0, 50.0)
HOLE_RADIUS_MM = 15.0
TUBE_RADIUS_MM, TUBE_LENGTH_MM = 30.0, 100.0


@dataclass(frozen=True)
class Truth:
    """An exact surface.

    Attributes
    ----------
    name : str
    mesh : SurfaceMesh, vertices exactly on the surface
    samples, sample_normals : (N, 3), area-uniform, exact
    closest : callable, points (N, 3) -> feet, normals, signed distances
    area_mm2 : float
    """

    name: str
    mesh: SurfaceMesh
    samples: Array
    sample_normals: Array
    closest: Callable[[Array], tuple[Array, Array, Array]]
    area_mm2: float


def truths(edge_mm: float = 1.0, n_samples: int = 200_000, seed: int = 7) -> list[Truth]:
    """Return the five benchmark surfaces."""
    random = np.random.default_rng(seed)
    return [
        _named("block-c", "sinusoid", edge_mm, n_samples, random),
        _dome(edge_mm, n_samples, random),
        _named("blade", "blade", edge_mm, n_samples, random),
        _named("block-c", "sinusoid with hole", edge_mm, n_samples, random, hole=True),
        _tube(edge_mm, n_samples, random),
    ]


def rough(truth: Truth, sigma_mm: float, seed: int = 11) -> Truth:
    """Return the same surface with Gaussian noise along the mesh's normals."""
    noise = np.random.default_rng(seed).normal(0, sigma_mm, len(truth.mesh.vertices))
    mesh = SurfaceMesh.from_triangles(truth.mesh.vertices + noise[:, None] * truth.mesh.normals, truth.mesh.faces)
    return Truth(truth.name, mesh, truth.samples, truth.sample_normals, truth.closest, truth.area_mm2)


def _named(
    part_name: str, name: str, edge_mm: float, n_samples: int, random: np.random.Generator, *, hole: bool = False
) -> Truth:
    part = named_part(part_name)
    (u0, u1), (v0, v1) = part.u_range, part.v_range
    grid_u, grid_v = part.grid(edge_mm)
    u, v = _jittered(grid_u, grid_v, random)
    faces = Delaunay(np.stack([(u - u0) * (grid_u.shape[0] / (u1 - u0)), (v - v0) * (grid_v.shape[1] / (v1 - v0))], 1))
    triangles = faces.simplices.astype(np.int64)
    if hole:
        u, v, triangles = _with_hole(u, v, edge_mm)
    vertices = part.surface(u, v)
    mesh = _outward(vertices, triangles, part.normal(u, v))
    su, sv = _area_uniform(part, 4 * n_samples, random)
    inside = (
        np.hypot(su - HOLE_CENTRE_MM[0], sv - HOLE_CENTRE_MM[1]) > HOLE_RADIUS_MM if hole else np.full(len(su), True)
    )
    U, V = np.meshgrid(np.linspace(u0, u1, 1601), np.linspace(v0, v1, 801), indexing="ij")
    S_u, S_v = part.derivatives(U, V)
    density = np.linalg.norm(np.cross(S_u, S_v), axis=-1)
    if hole:
        density = density * (np.hypot(U - HOLE_CENTRE_MM[0], V - HOLE_CENTRE_MM[1]) > HOLE_RADIUS_MM)
    area = float(density.mean() * (u1 - u0) * (v1 - v0))
    su, sv = su[inside][:n_samples], sv[inside][:n_samples]
    return Truth(name, mesh, part.surface(su, sv), part.normal(su, sv), part.closest, area)


def _jittered(grid_u: Array, grid_v: Array, random: np.random.Generator) -> tuple[Array, Array]:
    du, dv = grid_u[1, 0] - grid_u[0, 0], grid_v[0, 1] - grid_v[0, 0]
    u, v = grid_u.copy(), grid_v.copy()
    u[1:-1] += random.uniform(-0.25, 0.25, u[1:-1].shape) * du
    v[:, 1:-1] += random.uniform(-0.25, 0.25, v[:, 1:-1].shape) * dv
    return u.ravel(), v.ravel()


def _with_hole(u: Array, v: Array, edge_mm: float) -> tuple[Array, Array, IntArray]:
    x0, y0 = HOLE_CENTRE_MM
    keep = np.hypot(u - x0, v - y0) > HOLE_RADIUS_MM + 0.5 * edge_mm
    angle = np.arange(round(2 * np.pi * HOLE_RADIUS_MM / edge_mm)) * edge_mm / HOLE_RADIUS_MM
    angle *= 2 * np.pi / (angle[-1] + edge_mm / HOLE_RADIUS_MM)
    u = np.concatenate([u[keep], x0 + HOLE_RADIUS_MM * np.cos(angle)])
    v = np.concatenate([v[keep], y0 + HOLE_RADIUS_MM * np.sin(angle)])
    triangles = Delaunay(np.stack([u, v], axis=1)).simplices
    middle = np.stack([u[triangles].mean(axis=1), v[triangles].mean(axis=1)], axis=1)
    return u, v, triangles[np.hypot(middle[:, 0] - x0, middle[:, 1] - y0) > HOLE_RADIUS_MM * 0.999].astype(np.int64)


def _outward(vertices: Array, faces: IntArray, normals: Array) -> SurfaceMesh:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    faces = faces[np.linalg.norm(flat, axis=1) > 1e-6]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    wrong = np.einsum("fk,fk->f", np.cross(b - a, c - a), normals[faces].sum(axis=1)) < 0
    faces = np.where(wrong[:, None], faces[:, ::-1], faces)
    return SurfaceMesh.from_triangles(vertices, faces)


def _area_uniform(part: object, n: int, random: np.random.Generator) -> tuple[Array, Array]:
    u, v = random.uniform(*part.u_range, n), random.uniform(*part.v_range, n)  # type: ignore[attr-defined]
    S_u, S_v = part.derivatives(u, v)  # type: ignore[attr-defined]
    density = np.linalg.norm(np.cross(S_u, S_v), axis=1)
    keep = random.random(n) < density / density.max()
    return u[keep], v[keep]


def _dome(edge_mm: float, n_samples: int, random: np.random.Generator) -> Truth:
    part = named_part("dome")
    R = 50.0
    rim = R * np.pi / 2
    n = int(rim / edge_mm)
    rings, points = [rim * k / n for k in range(1, n + 1)], [np.zeros((1, 2))]
    for k, radius in enumerate(rings):
        count = max(6, round(2 * np.pi * R * np.sin(radius / R) / edge_mm))
        angle = (np.arange(count) + random.uniform(-0.2, 0.2, count) + 0.5 * (k % 2)) * 2 * np.pi / count
        r = radius + (random.uniform(-0.2, 0.2, count) * edge_mm if k < n - 1 else 0.0)
        points.append(np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1))
    flat = np.concatenate(points)
    r = np.linalg.norm(flat, axis=1)
    way = flat / np.maximum(r, 1e-12)[:, None]
    normal = np.column_stack([way * np.sin(r / R)[:, None], np.cos(r / R)])
    vertices = R * normal + (R, R, 0.0)
    mesh = _outward(vertices, Delaunay(flat).simplices.astype(np.int64), normal)
    z, phi = random.random(n_samples), random.uniform(0, 2 * np.pi, n_samples)
    s = np.column_stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z])
    return Truth("dome", mesh, R * s + (R, R, 0.0), s, lambda p: part.closest(p.copy()), 2 * np.pi * R * R)


def _tube(edge_mm: float, n_samples: int, random: np.random.Generator) -> Truth:
    R, length = TUBE_RADIUS_MM, TUBE_LENGTH_MM
    nx, na = round(length / edge_mm) + 1, round(2 * np.pi * R / edge_mm)
    x = np.repeat(np.linspace(0, length, nx), na).reshape(nx, na)
    a = np.tile(np.arange(na) * 2 * np.pi / na, (nx, 1)) + (np.arange(nx) % 2)[:, None] * np.pi / na
    x[1:-1] += random.uniform(-0.2, 0.2, (nx - 2, na)) * edge_mm
    a += random.uniform(-0.2, 0.2, (nx, na)) * edge_mm / R
    normal = np.stack([np.zeros_like(a), np.cos(a), np.sin(a)], axis=-1).reshape(-1, 3)
    vertices = R * normal + np.stack([x.ravel(), np.full(x.size, R), np.full(x.size, R)], axis=1)
    i, j = np.meshgrid(np.arange(nx - 1), np.arange(na), indexing="ij")
    p, q, s, t = i * na + j, (i + 1) * na + j, (i + 1) * na + (j + 1) % na, i * na + (j + 1) % na
    faces = np.concatenate([np.stack([p, q, s], -1).reshape(-1, 3), np.stack([p, s, t], -1).reshape(-1, 3)])
    mesh = _outward(vertices, faces.astype(np.int64), normal)
    sx, sa = random.uniform(0, length, n_samples), random.uniform(0, 2 * np.pi, n_samples)
    s_normal = np.column_stack([np.zeros(n_samples), np.cos(sa), np.sin(sa)])
    samples = R * s_normal + np.column_stack([sx, np.full((n_samples, 2), R)])
    return Truth("closed cylinder", mesh, samples, s_normal, _tube_closest, 2 * np.pi * R * length)


def _tube_closest(points: Array) -> tuple[Array, Array, Array]:
    d = points[:, 1:] - TUBE_RADIUS_MM
    r = np.linalg.norm(d, axis=1)
    normal = np.column_stack([np.zeros(len(points)), d / np.maximum(r, 1e-12)[:, None]])
    foot = TUBE_RADIUS_MM * normal
    foot[:, 0] = np.clip(points[:, 0], 0, TUBE_LENGTH_MM)
    foot[:, 1:] += TUBE_RADIUS_MM
    return foot, normal, np.einsum("nk,nk->n", points - foot, normal)
