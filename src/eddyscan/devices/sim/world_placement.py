"""Where the part really lies on the stage, and what an operator makes of it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.frames import Array, rotation_about_z, transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart
from eddyscan.devices.sim.world_settings import WorldPlacement

TRAVEL_MM = (203.2, 203.2, 40.0)
"""X-LSM200A, X-LSM200A, X-VSR40A: the study's table 3."""

LINK_ROOM_MM = 7.0
LOWEST_MM = 1.0
CLEARLY = 0.8


def hidden_pose(part: NominalPart, options: WorldPlacement, seed: int) -> Array:
    """Draw T_stage_part so that the part's outline stays inside the travels where it can.

    Yaw and lean are small, x and y sit in the middle of the travel, z leaves
    room for links above the top. A part higher than the z travel is reached
    at its top alone.
    """
    rng = np.random.default_rng([seed, 4])
    yaw, lean = options.yaw_deg * rng.uniform(-1, 1), options.lean_deg * rng.uniform(-1, 1, 2)
    R = rotation_about_z(yaw) @ Rotation.from_euler("xy", lean, degrees=True).as_matrix()
    top = part.top_mesh(4.0).vertices @ R.T
    low, high = top.min(axis=0), top.max(axis=0)
    room = np.array(TRAVEL_MM) - (high - low)
    room[2] -= LINK_ROOM_MM + LOWEST_MM
    at = np.array([0.0, 0.0, LOWEST_MM]) + np.where(room > 0, room * rng.uniform(0.3, 0.7, 3), room / 2)
    at[2] = min(at[2], TRAVEL_MM[2] - LINK_ROOM_MM - (high - low)[2])
    return transform(R, at - low)


def knocked(T_stage_part: Array, shift_mm: tuple[float, float, float]) -> Array:
    """Return the pose after the part was pushed by `shift_mm` [mm, stage]."""
    return transform(None, shift_mm) @ T_stage_part


def operators_pose(T_stage_part: Array, options: WorldPlacement, seed: int) -> Array:
    """Return the pose that an operator's jog to the corner (or a look) leaves: true pose with error."""
    rng = np.random.default_rng([seed, 5])
    if options.alignment == "exact":
        return T_stage_part
    if options.alignment == "corner":
        shift = options.corner_error_mm * np.clip(rng.standard_normal(3), -2, 2)
        turn = options.corner_error_deg * np.clip(rng.standard_normal(3), -2, 2)
    else:
        shift = options.rough_error_mm * rng.uniform(-1, 1, 3)
        turn = options.rough_error_deg * rng.uniform(-1, 1, 3) * (0.2, 0.2, 1.0)
    error = transform(Rotation.from_euler("xyz", turn, degrees=True).as_matrix(), shift)
    return np.asarray(T_stage_part @ error)


def surface_pose(part: NominalPart, surface: SurfaceMesh | None = None) -> Array:
    """Return T_part_surface of a surface whose bounding box begins at x = y = 0, its ends perhaps exchanged.

    A reconstruction cannot tell the ends of a symmetric part; a person who
    holds picture and part can. Of both ways the better fitting one is taken;
    without a surface the part's own.
    """
    top = part.top_mesh(4.0).vertices
    low, high = top.min(axis=0), top.max(axis=0)
    straight = transform(None, (low[0], low[1], 0.0))
    if surface is None:
        return straight
    turned = transform(rotation_about_z(180.0), (high[0], high[1], 0.0))
    spots = surface.vertices[:: max(1, len(surface.vertices) // 2000)]
    misfits = [np.abs(part.closest(spots @ T[:3, :3].T + T[:3, 3])[2]).mean() for T in (straight, turned)]
    return turned if misfits[1] < CLEARLY * misfits[0] else straight
