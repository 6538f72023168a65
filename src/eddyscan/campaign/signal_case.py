"""One `signal` case: a flaw in a flat field, what the coil reads over it, what the analysis makes of that.

Off the camera and the stage: the path is a raster at the technique's lift-off
with a smooth random error, the readings are the sound response of this coil plus
the crack's, the instrument's white noise is added, and the same `analyse` that a
real record goes through calls the indications.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter

from eddyscan.analysis import AnalysisResult, analyse
from eddyscan.campaign.library import SlotLibrary
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique
from eddyscan.physics import Coil, Conductor, air_inductance_h, impedance_ohm, to_slot_frame

NEAR_MM = 2.0
RIM_MM = 8.0
KNOTS = 61
MESH_MM = 1.0


@dataclass(frozen=True)
class SignalShared:
    """What every case needs, sent to each worker once.

    `libraries` has one entry per (frequency_hz, opening_mm).
    """

    technique: Technique
    libraries: dict[tuple[float, float], SlotLibrary]


def run_signal_cases(shared: SignalShared, cases: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per case."""
    return [run_signal_case(shared, case) for case in cases]


def run_signal_case(shared: SignalShared, case: Mapping[str, Any]) -> dict[str, Any]:
    """Return the case's values with what the analysis found: a pure function of values and seed.

    Row keys beside the case's own: found, score and the threshold it is called at,
    amplitude_ohm, position_error_mm, length_mm, depth_mm, false_calls, readings, seconds.
    """
    began = time.perf_counter()
    draw = np.random.default_rng(case["seed"])
    raster = FlatField(case, draw)
    technique = raster.technique(shared.technique)
    record = raster.record(shared, technique)
    result = analyse(record, raster.mesh(), technique)
    seconds = {"seconds": round(time.perf_counter() - began, 4)}
    return dict(case) | raster.outcome(result, technique) | {"readings": len(record)} | seconds


@lru_cache(maxsize=8)
def flat_mesh(width_mm: float, height_mm: float, edge_mm: float = MESH_MM) -> SurfaceMesh:
    """Return a flat rectangle at z = 0 with its corner at the origin."""
    xs, ys = (np.linspace(0.0, side, max(2, round(side / edge_mm) + 1)) for side in (width_mm, height_mm))
    y, x = (grid.ravel() for grid in np.meshgrid(ys, xs, indexing="ij"))
    index = np.arange(x.size).reshape(len(ys), len(xs))
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return SurfaceMesh.from_triangles(np.stack([x, y, np.zeros_like(x)], axis=1), faces)


class FlatField:
    """A square field of readings with one slot somewhere in its inner part."""

    def __init__(self, case: Mapping[str, Any], draw: np.random.Generator) -> None:
        self.case, self.draw = case, draw
        along = np.arange(0.0, case["field_mm"] + 1e-9, case["step_mm"])
        rows = np.arange(0.0, case["field_mm"] + 1e-9, case["pitch_mm"])
        self.shape = (len(rows), len(along))
        self.y, self.x = (grid.ravel() for grid in np.meshgrid(rows, along, indexing="ij"))
        self.centre = tuple(draw.uniform(RIM_MM, case["field_mm"] - RIM_MM, 2).tolist())
        angle = case["flaw_angle_deg"]
        self.angle_deg = float(draw.uniform(0.0, 180.0)) if angle is None else float(angle)
        self.height = np.clip(case["lift_off_mm"] + self._path_error(), 0.02, None)

    def _path_error(self) -> Array:
        sigma = self.case["lift_off_correlation_mm"]
        smooth = gaussian_filter(
            self.draw.standard_normal(self.shape),
            (sigma / self.case["pitch_mm"] / 2, sigma / self.case["step_mm"] / 2),
            mode="reflect",
        )
        return np.asarray(smooth / smooth.std() * self.case["lift_off_sd_mm"]).ravel()

    def technique(self, base: Technique) -> Technique:
        """Return the base technique with the case's frequency, lift-off and raster."""
        case = self.case
        drive = base.drive.model_copy(update={"frequency_hz": case["frequency_hz"]})
        scan = base.scan.model_copy(update={"lift_off_mm": case["lift_off_mm"]})
        # The probe of a flat raster stands on the normal: there is no tilt to find, which halves the analysis.
        raster = {"pitch_mm": case["pitch_mm"], "step_mm": case["step_mm"], "machine": "pose"}
        plan = base.plan.model_copy(update=raster)
        return base.model_copy(update={"drive": drive, "scan": scan, "plan": plan})

    def mesh(self) -> SurfaceMesh:
        """Return the field's flat surface, meshed as finely as a flat one needs."""
        return flat_mesh(self.case["field_mm"], self.case["field_mm"])

    def record(self, shared: SignalShared, technique: Technique) -> ScanRecord:
        """Return what the instrument reads over the field."""
        z, air = self._impedance(shared, technique)
        n, rows = self.x.size, self.shape[0]
        positions = np.stack([self.x, self.y, self.height], axis=1)
        return ScanRecord(
            row=np.repeat(np.arange(rows), self.shape[1]),
            point=np.tile(np.arange(self.shape[1]), rows),
            time_s=np.arange(n) * self.case["step_mm"] / technique.scan.speed_mm_s,
            stage_mm=positions,
            target_mm=positions,
            frequency_hz=np.full(n, self.case["frequency_hz"]),
            impedance_ohm=z,
            flag=np.zeros(n, dtype=np.int64),
            meta={"T_stage_part": np.eye(4).tolist(), "air": [air.real, air.imag]},
        )

    def _impedance(self, shared: SignalShared, technique: Technique) -> tuple[ComplexArray, complex]:
        case, probe = self.case, technique.probe
        r1, r2, length = 1.0 + case["coil_tolerance"] * self.draw.uniform(-1, 1, 3)
        coil = Coil(probe.inner_radius_mm * r1, probe.outer_radius_mm * r2, probe.length_mm * length, probe.turns)
        conductor = Conductor.half_space(technique.part.conductivity_ms_m)
        knots = np.linspace(0.9 * self.height.min(), 1.1 * self.height.max(), KNOTS)
        sound = CubicSpline(knots, impedance_ohm(coil, conductor, case["frequency_hz"], knots))
        air = 2j * np.pi * case["frequency_hz"] * air_inductance_h(coil)
        noise = self.draw.standard_normal((2, self.x.size))
        z = sound(self.height) + case["noise"] * air.imag * (noise[0] + 1j * noise[1]) / np.sqrt(2)
        table = shared.libraries[case["frequency_hz"], case["flaw_opening_mm"]].table(
            case["flaw_length_mm"], case["flaw_depth_mm"]
        )
        u, v = to_slot_frame(self.x, self.y, centre_mm=self.centre, angle_deg=self.angle_deg)
        near = (np.abs(u) <= table.grid.x_mm[-1]) & (np.abs(v) <= table.grid.y_mm[-1])
        height = np.clip(self.height[near], table.grid.lift_off_mm[0], table.grid.lift_off_mm[-1])
        z[near] += table.change_ohm(u[near], v[near], height)
        return np.asarray(z), complex(air)

    def outcome(self, result: AnalysisResult, technique: Technique) -> dict[str, Any]:
        """Return what was found of the flaw, and what was called elsewhere."""
        reach = NEAR_MM + 0.5 * self.case["flaw_length_mm"]
        distance = np.hypot(self.x - self.centre[0], self.y - self.centre[1])
        near = distance <= reach + technique.probe.outer_radius_mm
        # A call needs two readings above the level, so the second highest score decides.
        score = 0.0 if result.score is None else float(np.sort(np.nan_to_num(result.score[near]))[-2])
        size = np.nan_to_num(np.abs(result.residual_ohm[near])).max()
        calls = [(np.hypot(*(np.array(i.centre_mm[:2]) - self.centre)), i) for i in result.indications]
        ours = min((call for call in calls if call[0] <= reach), key=lambda call: float(call[0]), default=None)
        return {
            "flaw_angle_deg": self.angle_deg,
            "found": ours is not None,
            "score": score,
            "threshold": technique.analysis.threshold_mad,
            "amplitude_ohm": float(size),
            "position_error_mm": None if ours is None else float(ours[0]),
            "length_mm": None if ours is None else ours[1].length_mm,
            "depth_mm": None if ours is None else ours[1].depth_mm,
            "false_calls": sum(1 for distance_mm, _ in calls if distance_mm > reach),
        }
