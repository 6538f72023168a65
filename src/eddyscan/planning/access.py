"""Whether a probe can stand over a spot at all: its tip near enough, its body clear of part and table."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.spatial import KDTree

from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.technique import Technique
from eddyscan.planning.heights import HeightMap
from eddyscan.planning.probe_pose import vertical_stance
from eddyscan.planning.smooth import tangents_of

MOST_CHECKED = 1500
BODY_RINGS, BODY_ANGLES = 5, 6
# What enters a part passes its skin: only spots near it are asked, a ring every few mm.
NEAR_MM = 8.0
# Nearer than this to the skin of the mesh is contact, not penetration.
TOUCH_MM = 0.3


class Access(Protocol):
    """Tells which spots a probe can read."""

    @property
    def reason(self) -> str:
        """What is wrong with the others, in words."""

    def free(self, points: Array, normals: Array) -> BoolArray:
        """Return the mask (N,) of spots (N, 3) that can be read."""


class VerticalAccess:
    """A vertical probe: the true tip must come near enough for the coil to see the surface."""

    def __init__(self, heights: HeightMap, technique: Technique) -> None:
        self.heights, self.technique = heights, technique
        self.limit_mm = max(technique.analysis.lift_off_max_mm, 1.05 * technique.scan.lift_off_mm)

    @property
    def reason(self) -> str:
        return f"lift-off above {self.limit_mm:g} mm: too tight a radius or too steep for the tip"

    def free(self, points: Array, normals: Array) -> BoolArray:
        stance = vertical_stance(points, normals, self.heights, self.technique.probe, self.technique.scan.lift_off_mm)
        return np.asarray(stance.lift_off_mm <= self.limit_mm)


class AxialAccess:
    """A probe along the normal: stem and body must not reach into the part or below the table."""

    def __init__(self, mesh: SurfaceMesh, technique: Technique, table_z_mm: float | None) -> None:
        self.mesh, self.table_z_mm = mesh, table_z_mm
        self.tree = KDTree(mesh.vertices)
        self.skeleton = _body(technique)

    @property
    def reason(self) -> str:
        table = "" if self.table_z_mm is None else " or the table"
        return f"the probe's body would touch the part{table}"

    def free(self, points: Array, normals: Array) -> BoolArray:
        """Return which spots are free; of very many every few are checked and speak for their neighbours."""
        stride = max(1, len(points) // MOST_CHECKED)
        checked = np.arange(0, len(points), stride)
        p, n = points[checked], normals[checked]
        t = tangents_of(n)
        x, y, z = self.skeleton.T
        spots = p[:, None] + x[:, None] * t[:, None, 0] + y[:, None] * t[:, None, 1] + z[:, None] * n[:, None]
        flat = spots.reshape(-1, 3)
        distance, near = self.tree.query(flat, distance_upper_bound=NEAR_MM)
        close = np.isfinite(distance)
        near = np.where(close, near, 0)
        depth = np.einsum("nk,nk->n", flat - self.mesh.vertices[near], self.mesh.normals[near])
        hit = close & (depth < -TOUCH_MM)
        if self.table_z_mm is not None:
            hit |= flat[:, 2] < self.table_z_mm
        clear = ~hit.reshape(len(checked), -1).any(axis=1)
        return np.asarray(clear[np.minimum((np.arange(len(points)) + stride // 2) // stride, len(checked) - 1)])


def _body(technique: Technique) -> Array:
    """Return spots (K, 3) of stem and body in the frame of the surface spot, z along the outward normal."""
    probe = technique.probe
    shoulder = technique.scan.lift_off_mm + probe.stem_length_mm
    shoulder += probe.tip_radius_mm if probe.tip == "ball" else 0.0
    angle = np.arange(BODY_ANGLES) * 2 * np.pi / BODY_ANGLES
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = [np.column_stack([probe.tip_radius_mm * circle, np.full(BODY_ANGLES, 0.6 * shoulder)])]
    for z in shoulder + np.linspace(0, probe.body_length_mm, BODY_RINGS):
        rings.append(
            np.column_stack([max(probe.body_radius_mm, probe.tip_radius_mm) * circle, np.full(BODY_ANGLES, z)])
        )
    return np.concatenate(rings)
