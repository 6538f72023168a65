"""Which part of the surface is scanned: reachable, inside the margin, within the axes' travel."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.mesh import face_vectors
from eddyscan.core.technique import Probe
from eddyscan.planning.patches import Patch
from eddyscan.planning.probe_pose import RIM_CLEARANCE_MM
from eddyscan.planning.topology import border_edges

TRAVEL_RESERVE_MM = 0.5


def steepest_tilt_deg(probe: Probe, lift_off_max_mm: float) -> float:
    """Return the slope [deg] at which a vertical tip on a plane lifts the coil beyond the limit (at most 85)."""
    face = probe.tip_radius_mm if probe.tip == "flat" else probe.outer_radius_mm
    limit = np.degrees(np.arcsin(np.clip((lift_off_max_mm - RIM_CLEARANCE_MM) / face, 0, 1)))
    if probe.tip == "ball":
        limit = min(limit, np.degrees(np.arccos(np.clip(1 - lift_off_max_mm / probe.tip_radius_mm, 0, 1))))
    return float(min(limit, 85.0))


def faces_seen_from_above(vertices: Array, faces: IntArray, tilt_deg: float) -> BoolArray:
    """Return the mask (F,) of faces that look up, no steeper than `tilt_deg`."""
    flat = face_vectors(vertices, faces)
    length = np.linalg.norm(flat, axis=1)
    return np.asarray(flat[:, 2] > np.cos(np.radians(tilt_deg)) * np.maximum(length, 1e-300))


def border_distance(patch: Patch) -> Array:
    """Return each vertex's distance (V,) [mm] to the patch's border; inf when it has none."""
    edges = border_edges(patch.faces)
    if len(edges) == 0:
        return np.full(len(patch.vertices), np.inf)
    a, b = patch.vertices[edges[:, 0]], patch.vertices[edges[:, 1]]
    n = np.maximum(np.ceil(np.linalg.norm(b - a, axis=1) / 0.5).astype(int), 1)
    edge = np.repeat(np.arange(len(edges)), n)
    t = (np.arange(len(edge)) - np.repeat(np.cumsum(n) - n, n)) / n[edge]
    start = a + 0.0
    spots = start[edge] + t[:, None] * (b - a)[edge]
    _, near = KDTree(spots).query(patch.vertices)
    d, foot = (b - a)[edge[near]], a[edge[near]]
    u = np.einsum("nk,nk->n", patch.vertices - foot, d) / np.maximum(np.einsum("nk,nk->n", d, d), 1e-12)
    distance = np.linalg.norm(patch.vertices - foot - np.clip(u, 0, 1)[:, None] * d, axis=1)
    distance[edges.ravel()] = 0.0
    return np.asarray(distance)


def travel_guard(vertices: Array, travel_mm: tuple[float, float, float] | None, headroom_mm: float) -> Array:
    """Return how far (V,) [mm] each vertex is inside what the axes can span.

    The highest spot of the part plus `headroom_mm` is put at the top of z, the
    middle of the part in the middle of x and y; what lies beyond is negative.
    """
    if travel_mm is None:
        return np.full(len(vertices), np.inf)
    if min(travel_mm) <= headroom_mm:
        raise GeometryError(
            f"axis travels {travel_mm} mm leave no room to scan beside {headroom_mm:.1f} mm of clearance. "
            "Lower the clearance or use a longer axis."
        )
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    guard = np.full(len(vertices), np.inf)
    for axis in (0, 1):
        half = travel_mm[axis] / 2 - TRAVEL_RESERVE_MM
        if high[axis] - low[axis] > 2 * half:
            guard = np.minimum(guard, half - np.abs(vertices[:, axis] - (low[axis] + high[axis]) / 2))
    floor = high[2] + headroom_mm - travel_mm[2] + TRAVEL_RESERVE_MM
    if low[2] < floor:
        guard = np.minimum(guard, vertices[:, 2] - floor)
    return guard
