"""The part's pose on the stage from readings: distances to the surface and crossings of its rim."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from eddyscan.core.footing import SmoothSurface
from eddyscan.core.frames import Array, ComplexArray, apply, from_rotation_vector, invert, rotate, transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.rim import Rim, rim_of
from eddyscan.physics.sound_response import SoundResponse, curvature_gap_mm

ITERATIONS = 12
PRIOR_MM = 15.0
PRIOR_RAD = np.radians(4.0)
PRIOR_CROSSING_MM = 1.0
PRIOR_SCALE = 0.003
CONTACT_SIGMA_MM = 0.005
CROSSING_SIGMA_MM = 0.08
RIM_AVERAGE_MM = 1.0
SAME_RIM = 0.8
UNKNOWNS = 8


@dataclass(frozen=True)
class Evidence:
    """What the probe has met so far.

    Attributes
    ----------
    over_stage_mm : (C, 3) coil positions over the surface [mm, stage]
    over_ohm : (C,) complex [ohm] readings there
    edge_stage_mm : (E, 3) coil positions where the reading fell to a half at the rim
    edge_inward : (E, 3) inward direction [part] of the rim that was looked for
    """

    over_stage_mm: Array = field(default_factory=lambda: np.empty((0, 3)))
    over_ohm: ComplexArray = field(default_factory=lambda: np.empty(0, dtype=complex))
    edge_stage_mm: Array = field(default_factory=lambda: np.empty((0, 3)))
    edge_inward: Array = field(default_factory=lambda: np.empty((0, 3)))

    def with_contact(self, stage_mm: Array, impedance_ohm: complex) -> Evidence:
        """Return this with one more reading over the surface."""
        return replace(
            self,
            over_stage_mm=np.vstack([self.over_stage_mm, stage_mm]),
            over_ohm=np.append(self.over_ohm, impedance_ohm),
        )

    def with_crossing(self, stage_mm: Array, inward: Array) -> Evidence:
        """Return this with one more crossing of the rim."""
        return replace(
            self,
            edge_stage_mm=np.vstack([self.edge_stage_mm, stage_mm]),
            edge_inward=np.vstack([self.edge_inward, inward]),
        )


@dataclass(frozen=True)
class Pose:
    """A solved pose.

    Attributes
    ----------
    T_stage_part : (4, 4)
    scale : float
        True size over the mesh's size (the camera's scale error).
    crossing_mm : float [mm]
        How far outside the rim the reading falls to a half.
    covariance : (8, 8)
        Of rotation [rad] and shift [mm] about the part's middle, crossing [mm], scale.
    residual_mm : (C,) [mm] measured minus modelled lift-off
    unknowns : (8,) where the next solution begins
    """

    T_stage_part: Array
    scale: float
    crossing_mm: float
    covariance: Array
    residual_mm: Array
    unknowns: Array


class PoseSolver:
    """Gauss-Newton on pose, scale and crossing offset, with the operator's corner as a weak prior."""

    def __init__(self, mesh: SurfaceMesh, response: SoundResponse, T_rough: Array) -> None:
        self.surface = SmoothSurface(mesh)
        self.rim: Rim = rim_of(mesh)
        self.response = response
        self.T_rough = T_rough
        self.middle = mesh.vertices.mean(axis=0)
        uncertainty = 0.0 if mesh.uncertainty_mm is None else float(np.median(mesh.uncertainty_mm))
        self.contact_sigma_mm = float(np.hypot(CONTACT_SIGMA_MM, uncertainty))

    def solve(self, evidence: Evidence, begin: Pose | None = None) -> Pose:
        """Return the pose that explains the evidence best, beginning at an earlier one."""
        x = np.zeros(UNKNOWNS) if begin is None else begin.unknowns
        information = np.zeros((UNKNOWNS, UNKNOWNS))
        residual = np.zeros(0)
        for _ in range(ITERATIONS):
            J, r, residual = self._linear(evidence, x)
            information = J.T @ J + np.diag(self._prior())
            step = np.linalg.solve(information, -(J.T @ r) - self._prior() * x)
            x = x + step
            if np.abs(step).max() < 1e-8:
                break
        return Pose(
            self.pose_of(x), 1.0 + float(x[7]), float(x[6]), np.asarray(np.linalg.inv(information)), residual, x
        )

    def pose_of(self, x: Array) -> Array:
        """Return T_stage_part for unknowns (8,)."""
        about = transform(None, tuple(self.middle))
        return np.asarray(self.T_rough @ about @ from_rotation_vector(x[:3], x[3:6]) @ invert(about))

    def contact_row(self, part_mm: Array, normal: Array) -> Array:
        """Return d(distance) / d(unknowns) (M, 8) at points of the part."""
        arm = part_mm - self.middle
        rows = np.zeros((len(part_mm), UNKNOWNS))
        rows[:, :3] = -np.cross(arm, normal)
        rows[:, 3:6] = -normal
        rows[:, 7] = -(part_mm * normal).sum(axis=1)
        return rows

    def crossing_row(self, part_mm: Array, inward: Array) -> Array:
        """Return d(distance inside the rim + crossing offset) / d(unknowns) (M, 8)."""
        rows = self.contact_row(part_mm, inward)
        rows[:, 6] = 1.0
        return rows

    def near_rim(self, part_mm: Array, looked_for: Array) -> tuple[Array, Array]:
        """Return the rim's point and inward direction (E, 3), averaged over a few mm of the rim looked for."""
        point, inward = np.empty_like(part_mm), np.empty_like(part_mm)
        for k, (at, wanted) in enumerate(zip(part_mm, looked_for, strict=True)):
            side = np.flatnonzero(self.rim.inward @ wanted > SAME_RIM)
            away = np.linalg.norm(self.rim.points_mm[side] - at, axis=1)
            same = side[away <= away.min() + RIM_AVERAGE_MM]
            inward[k] = self.rim.inward[same].mean(axis=0)
            inward[k] /= np.linalg.norm(inward[k])
            offset = (self.rim.points_mm[same] - at) @ inward[k]
            point[k] = at + inward[k] * np.median(offset)
        return point, inward

    def _prior(self) -> Array:
        sigma = np.array([PRIOR_RAD] * 3 + [PRIOR_MM] * 3 + [PRIOR_CROSSING_MM, PRIOR_SCALE])
        return np.asarray(1.0 / sigma**2)

    def _linear(self, evidence: Evidence, x: Array) -> tuple[Array, Array, Array]:
        """Return Jacobian and residuals in units of their standard uncertainty, and contact residuals [mm]."""
        T_part_stage = invert(self.pose_of(x))
        scale = 1.0 + x[7]
        blocks, values = [np.zeros((0, UNKNOWNS))], [np.zeros(0)]
        contact = np.zeros(0)
        if len(evidence.over_ohm):
            at = apply(T_part_stage, evidence.over_stage_mm)
            axis = rotate(T_part_stage, np.array([[0.0, 0.0, -1.0]]))[0]
            below = self.surface.below(at / scale, axis=axis)
            lift_off = self.response.project(evidence.over_ohm, below.tilt_deg).lift_off_mm
            lift_off = lift_off - curvature_gap_mm(self.response.coil, lift_off, below.curvature_per_mm)
            contact = below.distance_mm * scale - lift_off
            known = np.isfinite(contact)
            contact = contact[known]
            blocks.append(self.contact_row(at[known], below.normal[known]) / self.contact_sigma_mm)
            values.append(contact / self.contact_sigma_mm)
        if len(evidence.edge_stage_mm):
            at = apply(T_part_stage, evidence.edge_stage_mm)
            point, inward = self.near_rim(at / scale, evidence.edge_inward)
            inside = ((at - point * scale) * inward).sum(axis=1)
            blocks.append(self.crossing_row(at, inward) / CROSSING_SIGMA_MM)
            values.append((inside + x[6]) / CROSSING_SIGMA_MM)
        return np.concatenate(blocks), np.concatenate(values), -contact
