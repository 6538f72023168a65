"""Rigid transforms between named frames.

``T_a_b`` is a (4, 4) float64 matrix [rotation, mm] that takes points of frame b
to frame a, so neighbours cancel: ``T_part_camera = T_part_stage @ T_stage_camera``.

Frames
------
camera : x right, y down, z forward (one per view).
table  : the table plane is z = 0, z up.
part   : z up, flat bottom at z = 0, x along the longer side, the inspected
         outline's bounding box begins at x = y = 0.
stage  : the axis readings; the probe's coil face is at (x, y, z) [mm].
probe  : origin at the centre of the coil face, z out of the face into the
         part, x along travel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from eddyscan.core.errors import GeometryError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

ORTHONORMAL_TOLERANCE = 1e-6


def transform(
    rotation: Array | None = None, translation_mm: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Array:
    """Build a (4, 4) rigid transform from a (3, 3) rotation and a (3,) translation [mm]."""
    T = np.eye(4)
    if rotation is not None:
        T[:3, :3] = rotation
    T[:3, 3] = translation_mm
    return T


def from_rotation_vector(vector_rad: Array, translation_mm: Array) -> Array:
    """Build a (4, 4) transform from a (3,) rotation vector [rad] and translation [mm]."""
    return transform(Rotation.from_rotvec(vector_rad).as_matrix(), translation_mm)


def rotation_about_z(angle_deg: float) -> Array:
    """Build the (3, 3) rotation by `angle_deg` about z."""
    return np.asarray(Rotation.from_euler("z", angle_deg, degrees=True).as_matrix())


def apply(T_a_b: Array, points_b: Array) -> Array:
    """Take points (N, 3) [mm, b] to frame a."""
    return np.asarray(points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3])


def rotate(T_a_b: Array, vectors_b: Array) -> Array:
    """Take directions (N, 3) [b] to frame a: the rotation alone."""
    return np.asarray(vectors_b @ T_a_b[:3, :3].T)


def invert(T_a_b: Array) -> Array:
    """Return T_b_a."""
    R = T_a_b[:3, :3].T
    return transform(R, -R @ T_a_b[:3, 3])


def angle_deg(T_a_b: Array) -> float:
    """Return the rotation angle [deg] of a transform."""
    return float(np.degrees(np.linalg.norm(Rotation.from_matrix(T_a_b[:3, :3]).as_rotvec())))


def checked_transform(value: Any, name: str) -> Array:
    """Return `value` as a rigid (4, 4) transform, or raise.

    Raises
    ------
    GeometryError
        When the shape is not (4, 4), an entry is not finite, or the upper left
        block is not a right-handed rotation.
    """
    T = np.asarray(value, dtype=np.float64)
    if T.shape != (4, 4):
        raise GeometryError(f"{name} has shape {T.shape}, a transform is 4x4.")
    if not np.isfinite(T).all():
        raise GeometryError(f"{name} holds NaN or infinite entries; measure the pose again or leave it out.")
    R = T[:3, :3]
    error = float(np.abs(R @ R.T - np.eye(3)).max())
    if error > 1e-3 or np.linalg.det(R) < 0:
        raise GeometryError(
            f"{name} is not a rigid transform: R R' differs from 1 by {error:.2g} (limit 0.001), "
            f"determinant {np.linalg.det(R):.3f} (must be +1). Check units and handedness."
        )
    return T
