"""The virtual cell: the truth, and the three devices that see it.

A depth camera ray-casts the part on its table; a Zaber controller moves the
probe; an LCR meter reads the coil. The software under test gets images,
positions and impedances through the devices' own wires and never the truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.devices.protocols import Clock
from eddyscan.devices.sim.camera import VirtualDepthCamera
from eddyscan.devices.sim.lcr import LcrSimulator
from eddyscan.devices.sim.lockin import LockInSimulator
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_placement import operators_pose, surface_pose
from eddyscan.devices.sim.world_probe import ProbeOverPart, StagePosition, TrueReading
from eddyscan.devices.sim.world_scene import build_scene
from eddyscan.devices.sim.world_settings import WorldSettings
from eddyscan.devices.sim.zaber import Fault, ZaberSimulator
from eddyscan.devices.sim.zaber_settings import STUDY_AXES, SimulatedAxis, ZaberSettings

__all__ = ["CellAddresses", "VirtualCell", "WorldSettings"]


TILT_AXIS: dict[str, Any] = {
    "model": "X-RSW60C",
    "serial_number": 104,
    "device_id": 99003,
    "unit": "deg",
    "travel": 120.0,
    "lower": -60.0,
    "microstep": 0.0009375,
    "max_speed": 60.0,
    "accuracy": 0.08,
    "backlash": 0.02,
    "noise": 0.001,
    "start": 0.0,
}
"""Microstep of the X-RSW60C as published; the rest PLACEHOLDERS."""


@dataclass(frozen=True)
class CellAddresses:
    """Where the cell's devices listen: what a real rig.toml would name."""

    stage: str
    instrument: str


class CoilAtStage:
    """The coil as the meter's terminals know it: follows the stage's true position."""

    def __init__(self, probe: ProbeOverPart, position: StagePosition, clock: Clock) -> None:
        self._probe, self._position, self._clock = probe, position, clock
        self._waiting: TrueReading | None = None

    def read(self, frequency_hz: float, aperture_s: float) -> complex:
        """Return the impedance [ohm] at the stage's true position now."""
        now = self._clock.now()
        z, self._waiting = self._probe.feel(self._position(), frequency_hz, now)
        return self._probe.noise.apply(z, self._probe.air_ohm(frequency_hz), now, aperture_s)

    def prepare(self, frequency_hz: float) -> None:
        """Get ready for a frequency."""
        self._probe.prepare(frequency_hz)

    def sent(self, impedance_ohm: complex) -> None:
        """File the truth under the numbers that went over the wire."""
        if self._waiting is not None:
            self._probe.remember(impedance_ohm, self._waiting)


class VirtualCell:
    """One part on a table and on a stage, with its hidden pose and flaws.

    Parameters
    ----------
    settings : WorldSettings
    clock : Clock
        Stage and instrument run in this clock's time.
    """

    def __init__(self, settings: WorldSettings, clock: Clock) -> None:
        self.settings, self.clock = settings, clock
        self._facts = facts_of(settings)
        self._probe = ProbeOverPart(settings, self._facts)
        self._T_part_surface = surface_pose(self._facts.part)
        self._addresses: CellAddresses | None = None
        self._camera: VirtualDepthCamera | None = None

    @cached_property
    def stage(self) -> ZaberSimulator:
        """The simulated controller: faults are injected here."""
        s, faults = self.settings.stage, self.settings.faults
        tilt = () if s.tilt_axis == "none" else (SimulatedAxis(name=s.tilt_axis, **TILT_AXIS),)
        options = ZaberSettings(
            layout=s.layout,
            firmware=s.firmware,
            reply_delay_s=s.reply_delay_s,
            seed=self.settings.seed,
            axes=(*STUDY_AXES, *tilt),
        )
        simulator = ZaberSimulator(options, self.clock)
        if faults.stage_fault != "none":
            simulator.inject(Fault(faults.stage_fault, after=faults.stage_fault_after, axis=faults.stage_fault_axis))
        return simulator

    @cached_property
    def instrument(self) -> LcrSimulator | LockInSimulator:
        """The simulated meter or lock-in."""
        o, faults = self.settings.instrument, self.settings.faults
        coil = CoilAtStage(self._probe, self.stage.true_position, self.clock)
        if o.kind != "E4980A":
            return LockInSimulator(coil, self.clock, model=o.kind, series_ohm=o.series_ohm, faults=faults)
        return LcrSimulator(
            coil,
            self.clock,
            short_s=o.short_s,
            latency_s=o.latency_s,
            digits=o.digits,
            overload_ohm=o.overload_ohm,
            faults=faults,
        )

    def camera(self) -> VirtualDepthCamera:
        """Return the depth camera over the table, where the part lies in a pose of its own."""
        if self._camera is None:
            s = self.settings
            scene = build_scene(s.part, seed=s.seed, clutter=s.clutter, edge_mm=s.mesh_edge_mm)
            self._camera = VirtualDepthCamera(scene, s.camera, s.seed)
        return self._camera

    def start(self) -> CellAddresses:
        """Start the stage controller and the meter on loopback ports; again: the same addresses."""
        if self._addresses is None:
            host, port = self.stage.start()
            meter_host, meter_port = self.instrument.start()
            self._addresses = CellAddresses(f"tcp://{host}:{port}", f"TCPIP::{meter_host}::{meter_port}::SOCKET")
        return self._addresses

    def rough_alignment(self, surface: SurfaceMesh | None = None) -> Array:
        """Return T_stage_part as an operator finds it, with the error that [world.placement] names.

        Parameters
        ----------
        surface : SurfaceMesh or None
            The surface the operator looks at. Its ends may be exchanged against
            the part's drawing; the operator jogs to the corner that the picture
            shows as origin.
        """
        self._T_part_surface = surface_pose(self._facts.part, surface)
        believed = operators_pose(self._facts.T_stage_part, self.settings.placement, self.settings.seed)
        return np.asarray(believed @ self._T_part_surface)

    def truth_log(self) -> dict[str, Any]:
        """Return what really was at every reading, JSON-able: for the truth part of summary.json alone."""
        readings = self._probe.history
        return {
            "T_stage_part": self._facts.T_stage_part.tolist(),
            "T_part_surface": self._T_part_surface.tolist(),
            "resistance_ohm": [z.real for z, _ in readings],
            "reactance_ohm": [z.imag for z, _ in readings],
            "time_s": [t.time_s for _, t in readings],
            "stage_mm": [t.stage_mm.tolist() for _, t in readings],
            "foot_mm": [t.foot_mm.tolist() for _, t in readings],
            "lift_off_mm": [t.lift_off_mm for _, t in readings],
            "tilt_deg": [t.tilt_deg for _, t in readings],
            "near_edge": [bool(t.near_edge) for _, t in readings],
            "body": [t.body for _, t in readings],
        }

    def close(self) -> None:
        """Stop the devices."""
        if self._addresses is not None:
            self.instrument.close()
            self.stage.close()
            self._addresses = None
        if self._camera is not None:
            self._camera.close()
