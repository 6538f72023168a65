"""Finding the part on the stage by touch: one corner, or three points and more.

An operator jogs the coil to places of the part that the drawing or the surface
knows. One corner gives where the part is and takes its edges to lie along the
axes (the study's home position); three points give its turn and tilt as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, from_rotation_vector, transform

TOUCH_MM = 0.1  # how well a person sets a coil on a corner, one standard deviation per axis
EDGE_DEG = 0.5  # how well a part is laid along the axes by eye
WORST_RESIDUAL = 4.0  # residual over touch uncertainty beyond which a touch was a slip


@dataclass(frozen=True)
class TouchAlignment:
    """Pose of the part on the stage and how well it is known.

    Attributes
    ----------
    T_stage_part : (4, 4) [mm]
    residual_mm : root mean square distance of touched and expected points; 0 for one corner
    uncertainty_mm : standard uncertainty of the position at the middle of the touched points
    uncertainty_deg : standard uncertainty of the rotation
    method : "corner" or "points"
    """

    T_stage_part: Array
    residual_mm: float
    uncertainty_mm: float
    uncertainty_deg: float
    method: str

    def note(self) -> dict[str, object]:
        """Return the alignment as the record keeps it."""
        return {**vars(self), "T_stage_part": self.T_stage_part.tolist()}


def align_from_corner(
    corner_stage_mm: Array, corner_part_mm: Array, *, yaw_deg: float = 0.0, touch_mm: float = TOUCH_MM
) -> TouchAlignment:
    """Place the part by one corner, its edges along the axes or turned by a known angle.

    Parameters
    ----------
    corner_stage_mm : (3,) axis readings with the coil on the corner [mm, stage]
    corner_part_mm : (3,) the corner [mm, part], for example (0, 0, height)
    yaw_deg : turn of the part about z, if known
    touch_mm : how well the corner was met, one standard deviation per axis
    """
    R = from_rotation_vector(np.array([0.0, 0.0, np.radians(yaw_deg)]), np.zeros(3))[:3, :3]
    T = transform(R, np.asarray(corner_stage_mm) - R @ np.asarray(corner_part_mm))
    return TouchAlignment(T, 0.0, touch_mm, EDGE_DEG, "corner")


def align_from_points(stage_mm: Array, part_mm: Array, *, touch_mm: float = TOUCH_MM) -> TouchAlignment:
    """Place the part by three or more touched points, least squares.

    Parameters
    ----------
    stage_mm, part_mm : (N, 3) the same points as axis readings and on the part [mm], N >= 3
    touch_mm : how well each was met, one standard deviation per axis

    Returns
    -------
    TouchAlignment
        Rotation by the singular value decomposition of the correlation matrix
        (Kabsch 1976). Uncertainties: touch error, or the residual when that is
        larger, carried through the linearised fit.

    Raises
    ------
    GeometryError
        For fewer than three points, points on a line, or a residual that no
        touch error explains.
    """
    stage, part = np.asarray(stage_mm, dtype=np.float64), np.asarray(part_mm, dtype=np.float64)
    if stage.shape != part.shape or stage.ndim != 2 or len(stage) < 3:
        raise GeometryError(f"{len(stage)} touched and {len(part)} part points; three or more pairs are needed.")
    a, b = part - part.mean(axis=0), stage - stage.mean(axis=0)
    spread = np.linalg.svd(a, compute_uv=False)
    if spread[1] < 0.05 * spread[0] or spread[0] < 1.0:
        raise GeometryError(
            f"the touched points lie on a line: they extend {spread[0]:.1f} x {spread[1]:.1f} mm (the shorter must be "
            "5 % of the longer). Touch a third point to the side."
        )
    U, _, Vt = np.linalg.svd(a.T @ b)
    D = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(Vt.T @ U.T)))])
    R = Vt.T @ D @ U.T
    off = b - a @ R.T
    residual = float(np.sqrt((off**2).sum(axis=1).mean()))
    _refuse_slip(off, residual, touch_mm)
    freedom = max(3 * len(stage) - 6, 1)
    sigma = max(touch_mm, float(np.sqrt((off**2).sum() / freedom)))
    turning = sum(float(p @ p) * np.eye(3) - np.outer(p, p) for p in a)  # information on the three rotations
    turn_rad = sigma * float(np.sqrt(np.trace(np.linalg.inv(turning)) / 3))
    T = transform(R, stage.mean(axis=0) - R @ part.mean(axis=0))
    return TouchAlignment(T, residual, sigma / float(np.sqrt(len(stage))), float(np.degrees(turn_rad)), "points")


def _refuse_slip(off: Array, residual: float, touch_mm: float) -> None:
    if residual > WORST_RESIDUAL * touch_mm:
        worst = int((off**2).sum(axis=1).argmax())
        raise GeometryError(
            f"the touched points do not fit the part: residual {residual:.2f} mm (limit "
            f"{WORST_RESIDUAL * touch_mm:.2f}), worst at point {worst + 1}. "
            "Check that each point is named as touched, and touch that one again."
        )
