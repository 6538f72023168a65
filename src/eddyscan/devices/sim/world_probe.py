"""What happens at the coil: true pose over the true part, felt as an impedance and remembered as truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from eddyscan.core.frames import Array, apply, invert
from eddyscan.devices.sim.flaws_response import SlotSignals
from eddyscan.devices.sim.instrument_physics import CoilResponse, edge_zone_mm, real_coil
from eddyscan.devices.sim.instrument_physics_noise import ReadingNoise
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


class ProbeOverPart:
    """The coil on the true part, at the place where the stage really is."""

    def __init__(self, settings: WorldSettings, facts: CellFacts) -> None:
        self._settings, self._flaws = settings, facts.flaws
        self._finder = FootFinder(facts.part)
        self._T_part_stage = invert(facts.T_stage_part)
        self._T_knocked = invert(knocked(facts.T_stage_part, settings.faults.part_shift_mm))
        lean = settings.placement.probe_tilt_deg * np.random.default_rng([settings.seed, 10]).uniform(-1, 1, 2)
        self._axis_stage = Rotation.from_euler("xy", lean, degrees=True).apply([0.0, 0.0, -1.0])
        self.coil = real_coil(settings.coil, settings.instrument.coil_tolerance, settings.seed)
        self.conductor = Conductor.half_space(settings.conductivity_ms_m)
        self.noise = ReadingNoise(settings.instrument, settings.seed)
        self.history: list[tuple[complex, TrueReading]] = []
        self._responses: dict[float, CoilResponse] = {}
        self._signals: dict[float, SlotSignals] = {}

    def pose(self, stage_mm: Array, time_s: float) -> TrueReading:
        """Return the truth for a coil position (3,) [mm, stage]."""
        shift_after = self._settings.faults.part_shift_after
        T = self._T_knocked if shift_after and len(self.history) >= shift_after else self._T_part_stage
        at = apply(T, stage_mm[None, :3])[0]
        foot = self._finder.at(at)
        axis = T[:3, :3] @ self._axis_stage
        tilt = float(np.degrees(np.arccos(np.clip(-axis @ foot.normal, -1.0, 1.0))))
        near = foot.edge_mm < edge_zone_mm(self.coil)
        return TrueReading(
            time_s, stage_mm[:3], at, foot.point_mm, foot.distance_mm, tilt, foot.edge_mm, near, foot.curvature_per_mm
        )

    def feel(self, stage_mm: Array, frequency_hz: float, time_s: float) -> tuple[complex, TrueReading]:
        """Return the coil's own impedance [ohm] at a place, and the truth behind it."""
        truth = self.pose(stage_mm, time_s)
        response = self._response(frequency_hz)
        gap = max(truth.lift_off_mm, 0.0)
        if truth.edge_mm > 0:
            bulge = curvature_gap_mm(self.coil, np.array(gap), np.array(truth.curvature_per_mm))
            gap = max(gap + float(bulge), 0.0)
        z = response.impedance_ohm(gap, truth.tilt_deg)
        if truth.edge_mm > 0 and self._flaws:
            z += self._slots(frequency_hz).change_ohm(truth.foot_mm, response.upright_lift_off_mm(z))
        return z, truth

    def prepare(self, frequency_hz: float) -> None:
        """Begin to build the slots' tables for a frequency the instrument was set to."""
        if self._flaws:
            self._slots(frequency_hz)

    def air_ohm(self, frequency_hz: float) -> complex:
        """Return j omega L0 of the real coil [ohm]."""
        return self._response(frequency_hz).air_ohm

    def remember(self, as_read_ohm: complex, truth: TrueReading) -> None:
        """File the truth under the impedance that the wire carried, which is all the software will know."""
        self.history.append((as_read_ohm, truth))

    def _slots(self, frequency_hz: float) -> SlotSignals:
        if frequency_hz not in self._signals:
            self._signals[frequency_hz] = SlotSignals(self._flaws, self.coil, self.conductor, frequency_hz)
        return self._signals[frequency_hz]

    def _response(self, frequency_hz: float) -> CoilResponse:
        if frequency_hz not in self._responses:
            self._responses[frequency_hz] = CoilResponse(self.coil, self.conductor, frequency_hz)
        return self._responses[frequency_hz]


def reading_key(impedance_ohm: complex) -> tuple[str, str]:
    """Return what tells one reading from another: both parts to seven digits, the noise makes them unique."""
    return f"{impedance_ohm.real:.6e}", f"{impedance_ohm.imag:.6e}"
