"""A tilt axis: which carriage position and angle put the coil face where the plan wants it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import Array, apply, from_rotation_vector, rotate
from eddyscan.core.plan import ScanPlan

LARGEST_MISS_DEG = 3.0
UPRIGHT_DEG = 0.1


@dataclass(frozen=True)
class TiltHead:
    """A rotary axis that tips the probe about a horizontal line through its pivot.

    At angle 0 the probe points straight down and the readings x, y, z are the
    coil face. Turned, the face swings about the pivot.

    Attributes
    ----------
    pivot_mm : height of the pivot above the coil face at angle 0
    about : (3,) unit vector of the rotation [stage], for example y: rows along x
    """

    pivot_mm: float
    about: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def swing(self, angle_deg: Array) -> Array:
        """Return how far the face moves (N, 3) [mm, stage] when the head turns from 0 by angles (N,)."""
        arm = np.array([0.0, 0.0, -self.pivot_mm])
        turned = [
            from_rotation_vector(np.radians(a) * np.array(self.about), np.zeros(3))[:3, :3] @ arm for a in angle_deg
        ]
        return np.asarray(np.array(turned) - arm, dtype=np.float64)

    def face(self, position: Array) -> Array:
        """Return the coil face (3,) [mm, stage] at axis readings (4,) x, y, z [mm] and angle [deg]."""
        return np.asarray(position[:3] + self.swing(position[3:4])[0])

    def axis_targets(self, faces: Array, pointing: Array) -> Array:
        """Return axis targets (N, 4) for coil faces (N, 3) [mm, stage] and probe directions (N, 3) [stage].

        Raises
        ------
        TravelError
            When a direction leans along the tilt line by more than 3 deg: one
            axis cannot follow it.
        """
        line = np.array(self.about)
        miss = np.degrees(np.arcsin(np.clip(np.abs(pointing @ line), 0.0, 1.0)))
        if miss.max() > LARGEST_MISS_DEG:
            worst = int(miss.argmax())
            raise TravelError(
                f"pose {worst} leans {miss[worst]:.1f} deg along the tilt axis, which one tilt axis cannot follow "
                f'(limit {LARGEST_MISS_DEG:g} deg). Turn the part, or plan with machine = "xyz".'
            )
        down = np.array([0.0, 0.0, -1.0])
        angle = np.degrees(np.arctan2(np.cross(down, pointing) @ line, pointing @ down))
        return np.column_stack([faces - self.swing(angle), angle])


def probe_directions(plan: ScanPlan, T_stage_part: Array) -> Array:
    """Return where the probe points (N, 3) [stage], out of the coil face into the part."""
    return rotate(T_stage_part, plan.T_part_probe[:, :3, 2])


def axis_targets(plan: ScanPlan, T_stage_part: Array, n_axes: int, head: TiltHead | None) -> tuple[Array, Array]:
    """Return (axis targets (N, n_axes), coil faces (N, 3)) [stage] of a plan.

    Raises
    ------
    TravelError
        When the plan tilts the probe and the stage cannot.
    """
    faces = apply(T_stage_part, plan.T_part_probe[:, :3, 3])
    pointing = probe_directions(plan, T_stage_part)
    if head is not None and n_axes == 4:
        return head.axis_targets(faces, pointing), faces
    lean = np.degrees(np.arccos(np.clip(-pointing[plan.is_scan, 2], -1.0, 1.0)))
    part_lean = np.degrees(np.arccos(np.clip(T_stage_part[2, 2], -1.0, 1.0)))
    if lean.max() > UPRIGHT_DEG + part_lean:
        raise TravelError(
            f"the plan tilts the probe by up to {lean.max():.1f} deg, this stage has {n_axes} axes and no known tilt "
            'head. Plan with machine = "xyz", or give the head\'s pivot in rig.toml.'
        )
    return np.column_stack([faces, np.zeros((len(faces), n_axes - 3))]), faces
