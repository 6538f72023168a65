"""The virtual inspection for the benchmark: same physics as the cell, whole scans at once.

Nothing goes over a wire here: the plan's poses become readings through the
physics room directly, so that twenty seeds of 70 000 readings take minutes. What
is on: winding sizes 2 % off, white noise of 0.01 % of X0, 1/f noise, temperature
drift of the wire, null offset, 0.2 % camera scale error, 50 um of smooth camera
error, a repeatable stage error map, the pose error that alignment leaves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from eddyscan import physics
from eddyscan.core.frames import Array, apply, from_rotation_vector, invert
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import NominalPart, named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique
from eddyscan.physics.sound_response import curvature_gap_mm, sound_response

WHITE, FLICKER, DRIFT_K = 1e-4, 3e-5, 0.5
WIRE_OHM, WIRE_PER_K, NULL_OHM = 1.2, 0.0039, 0.05
TOLERANCE, COILS = 0.02, 3
CAMERA_UM, CAMERA_CORRELATION_MM, CAMERA_SCALE = 50.0, 20.0, 0.002
STAGE_UM, STAGE_CORRELATION_MM, STAGE_NOISE_UM = 30.0, 60.0, 1.0
POSE_Z_MM, POSE_DEG, POSE_IN_PLANE_MM = 0.008, 0.003, 0.05
READING_S = 0.03
OPENING_MM = 0.1
MARGIN_MM, APART_MM = 8.0, 16.0
SIZES_MM = ((3.0, 1.0), (2.0, 0.5), (1.0, 0.3), (0.75, 0.25))


@dataclass(frozen=True)
class Flaw:
    centre_mm: Array
    along: Array
    across: Array
    slot: physics.Slot


class BenchCell:
    """One part with hidden pose, metal, coil and flaws."""

    def __init__(self, part: str, technique: Technique, seed: int, sizes: tuple[tuple[float, float], ...] = SIZES_MM):
        self.part: NominalPart = named_part(part)
        self.technique, self.seed = technique, seed
        self.rng = np.random.default_rng([seed, 41])
        self.coil = _coil(technique, seed % COILS)
        self.metal = physics.Conductor.half_space(technique.part.conductivity_ms_m)
        self.x0 = 2 * np.pi * technique.drive.frequency_hz * physics.air_inductance_h(self.coil)
        self.null = NULL_OHM * np.exp(2j * np.pi * self.rng.uniform())
        self.air_ohm = complex(1j * self.x0 + WIRE_OHM + self.null)
        self.flaws = _placed(self.part, sizes, self.rng)
        self.stage_error = [_smooth(self.rng, STAGE_CORRELATION_MM) for _ in range(3)]
        draw = self.rng.standard_normal
        turn = np.radians(POSE_DEG) * draw(3)
        shift = np.array([POSE_IN_PLANE_MM, POSE_IN_PLANE_MM, POSE_Z_MM]) * draw(3)
        self.T_stage_part = from_rotation_vector(np.radians([0.1, -0.1, 0.5]) * self.rng.uniform(-1, 1, 3), np.zeros(3))
        self.T_believed = self.T_stage_part @ from_rotation_vector(turn, shift)
        self._time_s = 0.0

    def camera_surface(self) -> SurfaceMesh:
        """Return what the camera made of the part."""
        mesh = self.part.top_mesh(1.0)
        error = 1e-3 * CAMERA_UM * _smooth(self.rng, CAMERA_CORRELATION_MM)(mesh.vertices[:, 0], mesh.vertices[:, 1])
        scale = 1.0 + CAMERA_SCALE * self.rng.choice([-1.0, 1.0])
        centre = mesh.vertices.mean(axis=0)
        vertices = centre + scale * (mesh.vertices - centre) + error[:, None] * mesh.normals
        return SurfaceMesh.from_triangles(vertices, mesh.faces, np.full(len(vertices), 1e-3 * CAMERA_UM))

    def true_lift_off(self, plan: ScanPlan) -> Array:
        """Return the true lift-off (N,) [mm] that a plan's readings would have."""
        return self.part.closest(self._true_places(plan)[1], iterations=5)[2]

    def _true_places(self, plan: ScanPlan) -> tuple[Array, Array]:
        """Return where the axes say the coil is [mm, stage] and where it really is [mm, part]."""
        target = apply(self.T_believed, plan.T_part_probe[plan.is_scan, :3, 3])
        error = np.stack([1e-3 * STAGE_UM * field(target[:, 0], target[:, 1]) for field in self.stage_error], axis=1)
        error += 1e-3 * STAGE_NOISE_UM * self.rng.standard_normal(target.shape)
        return target, apply(invert(self.T_stage_part), target + error)

    def scan(self, plan: ScanPlan) -> tuple[ScanRecord, Array]:
        """Return the record of a plan and the true lift-off (N,) [mm] at its readings."""
        scan = plan.is_scan
        axis = plan.T_part_probe[scan, :3, 2]
        target, true = self._true_places(plan)
        foot, normal, distance = self.part.closest(true, iterations=5)
        tilt = np.degrees(np.arccos(np.clip(-(axis * normal).sum(axis=1), -1, 1)))
        heard = self._heard(foot, normal, distance, tilt)
        n = len(target)
        meta = {
            "T_stage_part": self.T_believed.tolist(),
            "air": [self.air_ohm.real, self.air_ohm.imag],
            "coil": self._calibrated(),
        }
        times = self._time_s + READING_S * np.arange(n)
        record = ScanRecord(
            plan.row[scan],
            plan.point[scan],
            times,
            target,
            target.copy(),
            np.full(n, self.technique.drive.frequency_hz),
            heard + self._imperfect(times),
            np.zeros(n, dtype=np.int64),
            meta,
        )
        self._time_s = float(times[-1]) + 5.0
        return record, distance

    def _heard(self, foot: Array, normal: Array, distance: Array, tilt: Array) -> Array:
        tech = self.technique
        truth = sound_response(
            self.coil, self.metal, tech.drive.frequency_hz, largest_lift_off_mm=6.0, largest_tilt_deg=float(tilt.max())
        )
        lift_off = np.maximum(distance, truth.rim_mm(tilt))
        gap = curvature_gap_mm(self.coil, lift_off, _curvature(self.part, foot))
        heard = truth.impedance_ohm(lift_off + gap, tilt)
        upright = truth.project(heard, np.zeros_like(tilt)).lift_off_mm
        for flaw in self.flaws:
            offset = foot - flaw.centre_mm
            near = np.linalg.norm(offset, axis=1) < flaw.slot.length_mm / 2 + 4 * self.coil.outer_radius_mm
            if near.any():
                table = physics.slot_table(flaw.slot, self.coil, self.metal, tech.drive.frequency_hz)
                x, y = offset[near] @ flaw.along, offset[near] @ flaw.across
                heard[near] += table.change_ohm(x, y, np.clip(upright[near], 0, 2.9), beyond_is_zero=True)
        return heard + WIRE_OHM + self.null

    def _imperfect(self, times: Array) -> Array:
        n = len(times)
        noise = WHITE * self.x0 * _complex(self.rng, n)
        for tau in (0.1, 1.0, 10.0, 100.0, 1000.0):
            noise += FLICKER * self.x0 * _walk(self.rng, n, READING_S / tau)
        return noise + WIRE_OHM * WIRE_PER_K * DRIFT_K * np.sin(2 * np.pi * times / 1800.0)

    def _calibrated(self) -> dict[str, float]:
        """Return the coil as the alignment's approach fits it (its own noise included)."""
        from eddyscan.physics.coil_calibration import calibrate_coil

        tech, rng = self.technique, np.random.default_rng([self.seed, 43])
        height = 0.9 + np.cumsum([0.0, 0.15, 0.15, 0.15, 0.2, 0.2, 0.3, 0.4, 0.5, 0.7])
        heard = self.air_ohm + physics.impedance_change_ohm(self.coil, self.metal, tech.drive.frequency_hz, height)
        noise = WHITE * self.x0 / np.sqrt(3)
        heard = heard + noise * _complex(rng, len(height))
        p = tech.probe
        found = calibrate_coil(
            physics.Coil(p.inner_radius_mm, p.outer_radius_mm, p.length_mm, p.turns), tech.part.conductivity_ms_m,
            tech.drive.frequency_hz, height_mm=height + 1e-3 * rng.standard_normal(len(height)), impedance_ohm=heard,
            air_ohm=self.air_ohm, noise_ohm=noise / np.sqrt(2),
        )  # fmt: skip
        c = found.coil
        sizes = {"inner_radius_mm": c.inner_radius_mm, "outer_radius_mm": c.outer_radius_mm, "length_mm": c.length_mm}
        return {**sizes, "turns": c.turns, "conductivity_ms_m": found.conductivity_ms_m}


def _coil(technique: Technique, number: int) -> physics.Coil:
    p = technique.probe
    r1, r2, length = 1.0 + TOLERANCE * np.random.default_rng([number, 42]).uniform(-1, 1, 3)
    return physics.Coil(p.inner_radius_mm * r1, p.outer_radius_mm * r2, p.length_mm * length, p.turns)


def _placed(part: NominalPart, sizes: tuple[tuple[float, float], ...], rng: np.random.Generator) -> list[Flaw]:
    low, high = part.top_mesh(4.0).vertices[:, :2].min(axis=0), part.top_mesh(4.0).vertices[:, :2].max(axis=0)
    flaws: list[Flaw] = []
    while len(flaws) < len(sizes):
        at = rng.uniform(low + MARGIN_MM, high - MARGIN_MM)
        foot, normal, _ = part.closest(np.array([[at[0], at[1], 80.0]]))
        if any(np.linalg.norm(foot[0] - f.centre_mm) < APART_MM for f in flaws) or normal[0, 2] < 0.9:
            continue
        n, angle = normal[0], rng.uniform(0, np.pi)
        ex = np.array([1.0, 0, 0]) - n * n[0]
        ex /= np.linalg.norm(ex)
        along = np.cos(angle) * ex + np.sin(angle) * np.cross(n, ex)
        length, depth = sizes[len(flaws)]
        flaws.append(Flaw(foot[0], along, np.cross(n, along), physics.Slot(length, depth, OPENING_MM)))
    return flaws


def _curvature(part: NominalPart, foot: Array) -> Array:
    """Return the sum of the principal curvatures (N,) [1/mm] by the divergence of the normals."""
    step, total = 0.5, np.zeros(len(foot))
    _, normal, _ = part.closest(foot)
    first = np.cross(normal, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    for direction in (first, np.cross(normal, first)):
        _, ahead, _ = part.closest(foot + step * direction, iterations=4)
        _, behind, _ = part.closest(foot - step * direction, iterations=4)
        total += ((ahead - behind) * direction).sum(axis=1) / (2 * step)
    return total


def _smooth(rng: np.random.Generator, correlation_mm: float) -> RectBivariateSpline:
    """Return a random field of unit variance over 260 x 260 mm."""
    knots = np.arange(-30.0, 260.0, correlation_mm / 2)
    values = rng.standard_normal((len(knots), len(knots)))
    field = RectBivariateSpline(knots, knots, values, kx=3, ky=3)
    fine = np.linspace(0, 200, 60)
    scale = field(fine, fine).std()
    return lambda x, y: field.ev(x, y) / scale


def _complex(rng: np.random.Generator, n: int) -> Array:
    return (rng.standard_normal(n) + 1j * rng.standard_normal(n)) / np.sqrt(2)


def _walk(rng: np.random.Generator, n: int, share: float) -> Array:
    from scipy.signal import lfilter

    keep = np.exp(-share)
    return lfilter([np.sqrt(1 - keep**2)], [1, -keep], _complex(rng, n))
