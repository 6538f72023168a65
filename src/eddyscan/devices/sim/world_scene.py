"""The table of the virtual cell: the part, other objects, and where the camera stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.frames import Array, apply, invert, rotation_about_z, transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart, named_part
from eddyscan.devices.sim.world_settings import WorldCamera

TABLE_MM = 1400.0
PART_SOLID = 1
OS30A = PinholeCamera(fx=833.0, fy=833.0, cx=645.9, cy=439.4, width=1280, height=920, depth_scale_mm=0.05)
"""The study's camera: intrinsics of its table 1; counts of 0.05 mm keep 2500 mm within 16 bits."""

SEEN_SHARE = 0.9
RETREAT_MM = 10.0


@dataclass(frozen=True)
class Scene:
    """Everything on the table; the table plane is z = 0 of the table frame.

    Attributes
    ----------
    part : NominalPart
    T_table_part : (4, 4)
    meshes : tuple of SurfaceMesh [mm, table]
        The table first, the part second (number PART_SOLID), then the others.
    """

    part: NominalPart
    T_table_part: Array
    meshes: tuple[SurfaceMesh, ...]


def build_scene(part_name: str, *, seed: int, clutter: int, edge_mm: float) -> Scene:
    """Put the part and `clutter` other objects on a table, all places from `seed`."""
    part = named_part(part_name)
    rng = np.random.default_rng([seed, 1])
    T = transform(rotation_about_z(rng.uniform(0.0, 360.0)), (*rng.uniform(-30.0, 30.0, 2), 0.0))
    solid = part.solid_mesh(edge_mm)
    low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    others = _place_clutter(low, high, clutter, rng)
    meshes = (_table(), solid.moved(T, "table"), *(mesh.moved(T, "table") for mesh in others))
    return Scene(part, T, meshes)


def _table() -> SurfaceMesh:
    h = TABLE_MM / 2
    corners = np.array([[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]])
    return SurfaceMesh.from_triangles(corners, np.array([[0, 1, 2], [0, 2, 3]]), frame="table")


def prism(outline: Array, height_mm: float) -> SurfaceMesh:
    """Return a closed upright prism over a convex outline (N, 2) [mm], standing on z = 0."""
    n = len(outline)
    low = np.column_stack([outline, np.zeros(n)])
    vertices = np.concatenate([low, np.column_stack([outline, np.full(n, height_mm)])])
    k = np.arange(n)
    nxt = np.roll(k, -1)
    fan = np.stack([np.zeros(n - 2, dtype=int), k[1:-1], k[2:]], axis=1)
    sides = np.concatenate([np.stack([k, nxt, nxt + n], 1), np.stack([k, nxt + n, k + n], 1)])
    return SurfaceMesh.from_triangles(vertices, np.concatenate([fan[:, ::-1], fan + n, sides]))


def _clutter_object(kind: int, rng: np.random.Generator) -> tuple[SurfaceMesh, float]:
    """Return one object around the origin and the radius of its footprint [mm]."""
    if kind == 0 or kind == 3:
        half = rng.uniform(15.0, 25.0, 2) if kind == 0 else np.array([rng.uniform(35.0, 50.0), rng.uniform(6.0, 10.0)])
        box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        return prism(box, rng.uniform(12.0, 40.0)), float(np.hypot(*half))
    radius = rng.uniform(12.0, 22.0)
    if kind == 1:
        angle = np.linspace(0, 2 * np.pi, 49)[:-1]
        return prism(radius * np.column_stack([np.cos(angle), np.sin(angle)]), rng.uniform(15.0, 40.0)), float(radius)
    dome = named_part("dome").solid_mesh(2.0)
    return SurfaceMesh.from_triangles((dome.vertices - (50.0, 50.0, 0.0)) * radius / 50.0, dome.faces), float(radius)


def _place_clutter(low: Array, high: Array, count: int, rng: np.random.Generator) -> list[SurfaceMesh]:
    """Place box, cylinder, dome and bar in turn round the part, none touching another."""
    placed: list[tuple[Array, float]] = []
    meshes: list[SurfaceMesh] = []
    for k in range(count):
        mesh, radius = _clutter_object(k % 4, rng)
        for _ in range(200):
            centre = rng.uniform(low[:2] - 110.0, high[:2] + 110.0)
            beside = np.maximum(np.maximum(low[:2] - centre, centre - high[:2]), 0.0)
            clear = float(np.hypot(*beside)) > radius + 12.0
            if clear and all(np.hypot(*(centre - c)) > radius + r + 8.0 for c, r in placed):
                placed.append((centre, radius))
                turn = rotation_about_z(rng.uniform(0.0, 360.0))
                meshes.append(mesh.moved(transform(turn, (*centre, 0.0)), "part"))
                break
    return meshes


def camera_poses(scene: Scene, options: WorldCamera, n: int, rng: np.random.Generator) -> list[Array]:
    """Draw `n` camera poses T_table_camera round the part.

    Stand-off, tilt and roll are drawn from the options, azimuths spread evenly
    with jitter. The camera steps back until it holds 90 % of the part's top
    beyond its least range.
    """
    top = scene.part.top_mesh(8.0).vertices
    middle = 0.5 * (top.min(axis=0) + top.max(axis=0))
    first = rng.uniform(0.0, 360.0)
    poses = []
    for k in range(n):
        azimuth = np.radians(first + (k + rng.uniform(-0.25, 0.25)) * 360.0 / n)
        tilt = np.radians(rng.uniform(*options.tilt_deg))
        roll = np.radians(rng.uniform(-options.roll_deg, options.roll_deg))
        aim = apply(scene.T_table_part, middle[None])[0] + (*rng.uniform(-10.0, 10.0, 2), 0.0)
        away = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
        stand_off = rng.uniform(*options.stand_off_mm)
        pose = _looking(aim + stand_off * away, -away, roll)
        for _ in range(20):
            if _share_seen(pose, apply(scene.T_table_part, top), options.range_mm[0]) >= SEEN_SHARE:
                break
            stand_off += RETREAT_MM
            pose = _looking(aim + stand_off * away, -away, roll)
        poses.append(pose)
    return poses


def _looking(eye: Array, forward: Array, roll_rad: float) -> Array:
    """Return T_table_camera of a camera at `eye` that looks along `forward`."""
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) < 1e-6:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    return transform(np.column_stack([c * right + s * down, c * down - s * right, forward]), eye)


def _share_seen(T_table_camera: Array, points: Array, least_mm: float) -> float:
    seen = apply(invert(T_table_camera), points)
    z = np.maximum(seen[:, 2], 1e-6)
    u, v = OS30A.fx * seen[:, 0] / z + OS30A.cx, OS30A.fy * seen[:, 1] / z + OS30A.cy
    inside = (u > 0) & (u < OS30A.width - 1) & (v > 0) & (v < OS30A.height - 1)
    return float((inside & (seen[:, 2] > least_mm)).mean())
