"""Where the probe stands at each reading: lift-off, tilt, and never into the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.technique import Probe
from eddyscan.planning.heights import HeightMap, overlap_mm, tip_shape

DOWN = np.array([0.0, 0.0, -1.0])
RISES = 8
TOUCH_MM = 0.002
RIM_CLEARANCE_MM = 0.05  # the rim of a tilted face keeps this far off the surface


@dataclass(frozen=True)
class Stance:
    """Probe poses over surface points.

    Attributes
    ----------
    face_mm : (N, 3) centres of the coil face [part]
    axis : (N, 3) unit, out of the coil face into the part
    lift_off_mm : (N,) distance of the coil face's centre to the surface
    tilt_deg : (N,) between axis and surface normal
    """

    face_mm: Array
    axis: Array
    lift_off_mm: Array
    tilt_deg: Array


def vertical_stance(points: Array, normals: Array, heights: HeightMap, probe: Probe, lift_off_mm: float) -> Stance:
    """Stand a vertical probe over points (N, 3) so that each stays the coil's nearest spot.

    The coil backs off along the surface normal from the wanted lift-off until
    the true tip, stem and body clear the part (drop cutter).
    """
    shape = tip_shape(probe)
    lift = np.full(len(points), lift_off_mm)
    up = np.clip(normals[:, 2], 0.05, 1.0)
    # On a plane a flat face of radius R needs R sin of the slope at once; curvature and edges are found by the map.
    slope = np.sqrt(np.maximum(1 - up**2, 0))
    radius = probe.tip_radius_mm if probe.tip == "flat" else probe.outer_radius_mm
    lift = np.maximum(lift, radius * slope + np.minimum(RIM_CLEARANCE_MM, slope))
    busy = np.arange(len(points))
    for _ in range(RISES):
        into = overlap_mm(heights, shape, points[busy] + lift[busy, None] * normals[busy])
        deep = into > TOUCH_MM
        busy = busy[deep]
        if busy.size == 0:
            break
        lift[busy] += into[deep] * up[busy]
    face_mm = points + lift[:, None] * normals
    if busy.size:
        # Beside a wall the way along the normal may not clear: the rest is straight up.
        into = np.maximum(overlap_mm(heights, shape, face_mm[busy]), 0.0)
        face_mm[busy, 2] += into
        lift[busy] += into * up[busy]
    tilt = np.degrees(np.arccos(np.clip(normals[:, 2], -1, 1)))
    return Stance(face_mm, np.broadcast_to(DOWN, points.shape).copy(), lift, tilt)


def normal_stance(points: Array, normals: Array, lift_off_mm: float) -> Stance:
    """Stand the probe's axis on the surface normal."""
    lift = np.full(len(points), lift_off_mm)
    return Stance(points + lift_off_mm * normals, -normals, lift, np.zeros(len(points)))


def frames_of(face_mm: Array, axis: Array, travel: Array) -> Array:
    """Return T_part_probe (N, 4, 4): z along `axis`, x along `travel` as far as that is across."""
    x = travel - np.einsum("nk,nk->n", travel, axis)[:, None] * axis
    short = np.linalg.norm(x, axis=1) < 1e-9
    if short.any():
        spare = np.where(np.abs(axis[short, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        x[short] = spare - np.einsum("nk,nk->n", spare, axis[short])[:, None] * axis[short]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    T = np.zeros((len(face_mm), 4, 4))
    T[:, :3, 0], T[:, :3, 1], T[:, :3, 2] = x, np.cross(axis, x), axis
    T[:, :3, 3], T[:, 3, 3] = face_mm, 1.0
    return T
