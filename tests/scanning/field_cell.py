"""The virtual cell without its wires: stage and meter as plain objects, for tests of what the probe does."""

from __future__ import annotations

import numpy as np

from eddyscan.core.frames import Array, invert
from eddyscan.core.parts import named_part
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.protocols import Axis, Identity, ImpedanceReading
from eddyscan.devices.sim.instrument_physics_noise import ReadingNoise
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_placement import TRAVEL_MM, operators_pose
from eddyscan.devices.sim.world_probe import ProbeOverPart
from eddyscan.devices.sim.world_settings import WorldSettings

ACCELERATION = 400.0


class FieldCell:
    """A stage that moves a probe over the world's part."""

    def __init__(self, settings: WorldSettings, clock: VirtualClock) -> None:
        facts = facts_of(settings)
        self.T_stage_part = facts.T_stage_part
        self.rough = operators_pose(self.T_stage_part, settings.placement, settings.seed)
        self.probe = ProbeOverPart(settings, facts)
        self.noise = ReadingNoise(settings.instrument, settings.seed)
        self.clock = clock
        self.at = np.array([100.0, 100.0, TRAVEL_MM[2]])
        self.lowest_gap_mm = np.inf
        self.moves = 0
        self.stops = 0

    # the stage
    def identity(self) -> Identity:
        return Identity("stage", "plain", "0")

    def axes(self) -> list[Axis]:
        return [Axis(n, 0.0, t, 1e-4, 100.0, ACCELERATION) for n, t in zip("xyz", TRAVEL_MM, strict=True)]

    def home(self) -> None: ...

    def is_homed(self) -> bool:
        return True

    def move(self, target: Array, speed: float | None = None) -> None:
        way = float(np.linalg.norm(target - self.at))
        v = speed or 100.0
        self.clock.sleep(way / v + v / ACCELERATION + 0.02)
        self.at = np.array(target, dtype=float)
        self.moves += 1
        pose = self.probe.pose(self.at, self.clock.now())
        self.lowest_gap_mm = min(self.lowest_gap_mm, pose.lift_off_mm if pose.edge_mm > 0 else np.inf)

    def position(self) -> Array:
        return self.at.copy()

    def stop(self) -> None:
        self.stops += 1

    # the meter
    def configure(self, drive: object) -> None:
        self.frequency_hz = drive.frequency_hz  # type: ignore[attr-defined]

    def read(self) -> ImpedanceReading:
        self.clock.sleep(0.006)
        now = self.clock.now()
        z, _ = self.probe.feel(self.at, self.frequency_hz, now)
        z = self.noise.apply(z, self.probe.air_ohm(self.frequency_hz), now, 0.0056)
        return ImpedanceReading(z, now)

    def close(self) -> None: ...


def pose_error(cell: FieldCell, T_stage_part: Array) -> dict[str, float]:
    """Return how far a pose is off: z and in-plane at the part's middle [mm], tilt and yaw [deg]."""
    delta = invert(cell.T_stage_part) @ T_stage_part
    middle = named_part(cell.probe._settings.part).top_mesh(8.0).vertices.mean(axis=0)
    shift = delta[:3, :3] @ middle + delta[:3, 3] - middle
    from scipy.spatial.transform import Rotation

    turn = np.degrees(Rotation.from_matrix(delta[:3, :3]).as_rotvec())
    return {
        "z_mm": abs(float(shift[2])),
        "in_plane_mm": float(np.linalg.norm(shift[:2])),
        "tilt_deg": float(np.linalg.norm(turn[:2])),
        "yaw_deg": abs(float(turn[2])),
    }
