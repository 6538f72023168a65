"""What happens at the coil: true pose over the true part, felt as an impedance and remembered as truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.frames import Array, apply, invert
from eddyscan.devices.sim.instrument_physics import CoilResponse, edge_zone_mm, real_coil
from eddyscan.devices.sim.instrument_physics_noise import ReadingNoise
from eddyscan.devices.sim.world_body import Body, reference_block
from eddyscan.devices.sim.world_facts import CellFacts
from eddyscan.devices.sim.world_foot import FootFinder
from eddyscan.devices.sim.world_placement import knocked
from eddyscan.devices.sim.world_settings import WorldSettings
from eddyscan.physics import Conductor
from eddyscan.physics.sound_response import curvature_gap_mm

StagePosition = Callable[[], Array]


@dataclass(frozen=True)
class TrueReading:
    """What really was, when the instrument read.

    Attributes
    ----------
    time_s : the cell's clock
    stage_mm : (3,) true coil position [mm, stage]
    part_mm : (3,) the same [mm, part]
    foot_mm : (3,) spot below it [mm, part]
    lift_off_mm : float, along the surface normal; negative: the tip is pressed into the part
    tilt_deg : probe axis against the surface normal
    edge_mm : distance of the spot to the outline, negative beyond it
    near_edge : whether the reading is within the zone that has no physics
    curvature_per_mm : sum of the principal curvatures at the spot
    body : "part", or "reference" for the block; then `part_mm` and `foot_mm` are in the block's frame
    """

    time_s: float
    stage_mm: Array
    part_mm: Array
    foot_mm: Array
    lift_off_mm: float
    tilt_deg: float
    edge_mm: float
    near_edge: bool
    curvature_per_mm: float
    body: str = "part"


class ProbeOverPart:
    """The coil on the true part, at the place where the stage really is."""

    def __init__(self, settings: WorldSettings, facts: CellFacts) -> None:
        self._settings = settings
        self._T_part_stage = invert(facts.T_stage_part)
        self._T_knocked = invert(knocked(facts.T_stage_part, settings.faults.part_shift_mm))
        lean = settings.placement.probe_tilt_deg * np.random.default_rng([settings.seed, 10]).uniform(-1, 1, 2)
        self._axis_stage = np.asarray(Rotation.from_euler("xy", lean, degrees=True).apply([0.0, 0.0, -1.0]))
        self.coil = real_coil(settings.coil, settings.instrument.coil_tolerance, settings.seed)
        self.conductor = Conductor.half_space(settings.conductivity_ms_m)
        metal = (self.coil, self.conductor)
        self._body = Body("part", FootFinder(facts.part), facts.flaws, metal)
        self._reference = reference_block(settings, metal)
        self.noise = ReadingNoise(settings.instrument, settings.seed)
        self.history: list[tuple[complex, TrueReading]] = []
        self._responses: dict[float, CoilResponse] = {}

    def pose(self, stage_mm: Array, time_s: float) -> TrueReading:
        """Return the truth for true axis readings (n_axes,) [mm, deg, stage]."""
        body, T = self._below(stage_mm)
        at = apply(T, stage_mm[None, :3])[0]
        foot = body.finder.at(at)
        axis = T[:3, :3] @ self._probe_axis(stage_mm)
        tilt = float(np.degrees(np.arccos(np.clip(-axis @ foot.normal, -1.0, 1.0))))
        near = foot.edge_mm < edge_zone_mm(self.coil)
        return TrueReading(
            time_s=time_s, stage_mm=stage_mm[:3], part_mm=at, foot_mm=foot.point_mm, lift_off_mm=foot.distance_mm,
            tilt_deg=tilt, edge_mm=foot.edge_mm, near_edge=near, curvature_per_mm=foot.curvature_per_mm, body=body.name,
        )  # fmt: skip

    def feel(self, stage_mm: Array, frequency_hz: float, time_s: float) -> tuple[complex, TrueReading]:
        """Return the coil's own impedance [ohm] at a place, and the truth behind it."""
        truth = self.pose(stage_mm, time_s)
        response = self._response(frequency_hz)
        gap = max(truth.lift_off_mm, 0.0)
        if truth.edge_mm > 0:
            bulge = curvature_gap_mm(self.coil, np.array(gap), np.array(truth.curvature_per_mm))
            gap = max(gap + float(bulge), 0.0)
        z = response.impedance_ohm(gap, truth.tilt_deg)
        if truth.edge_mm > 0:
            body, _ = self._below(stage_mm)
            z += body.slots_ohm(truth.foot_mm, response.upright_lift_off_mm(z), frequency_hz)
        return z, truth

    def prepare(self, frequency_hz: float) -> None:
        """Begin to build the slots' tables for a frequency the instrument was set to."""
        self._body.prepare(frequency_hz)

    def air_ohm(self, frequency_hz: float) -> complex:
        """Return j omega L0 of the real coil [ohm]."""
        return self._response(frequency_hz).air_ohm

    def remember(self, as_read_ohm: complex, truth: TrueReading) -> None:
        """File the truth under the impedance that the wire carried, which is all the software will know."""
        self.history.append((as_read_ohm, truth))

    def _below(self, stage_mm: Array) -> tuple[Body, Array]:
        """Return the body the coil is over and T_body_stage."""
        if self._reference is not None and self._reference.below(stage_mm):
            return self._reference, self._reference.T_body_stage
        shift_after = self._settings.faults.part_shift_after
        shifted = shift_after and len(self.history) >= shift_after
        return self._body, self._T_knocked if shifted else self._T_part_stage

    def _probe_axis(self, stage_mm: Array) -> Array:
        """Return the direction out of the coil face (3,) [stage], turned by the tilt axis if there is one."""
        if len(stage_mm) < 4:
            return self._axis_stage
        about = "x" if self._settings.stage.tilt_axis == "a" else "y"
        return np.asarray(Rotation.from_euler(about, float(stage_mm[3]), degrees=True).apply(self._axis_stage))

    def _response(self, frequency_hz: float) -> CoilResponse:
        if frequency_hz not in self._responses:
            self._responses[frequency_hz] = CoilResponse(self.coil, self.conductor, frequency_hz)
        return self._responses[frequency_hz]


def reading_key(impedance_ohm: complex) -> tuple[str, str]:
    """Return what tells one reading from another: both parts to seven digits, the noise makes them unique."""
    return f"{impedance_ohm.real:.6e}", f"{impedance_ohm.imag:.6e}"
