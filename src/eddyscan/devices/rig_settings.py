"""What rig.toml may say: one model per table, the virtual rig, and the commented text."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from eddyscan.core.commented_toml import commented_toml
from eddyscan.core.frames import Array, transform
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Section
from eddyscan.devices.sim.world_settings import WorldSettings, WorldStage

HEADING = """The rig: what changes with a spanner. Lengths in mm, angles in deg.
driver names module:Class, so a driver of your own package works; its own keys stand in the
table's options. Without [world] the rig is real and moves only with --arm."""


class StageTable(Section):
    """Stage."""

    driver: str = "eddyscan.devices.drivers.zaber:ZaberStage"
    address: str | None = Field(None, description="tcp://host:port or a serial port; the virtual cell fills it in")
    travel_mm: tuple[float, float, float] = Field((203.2, 203.2, 40.0), description="x, y, z travel to plan within, mm")
    options: dict[str, Any] = Field({}, description="keys of the driver's own settings")


class InstrumentTable(Section):
    """Eddy-current instrument."""

    driver: str = "eddyscan.devices.drivers.keysight_e4980a:KeysightE4980A"
    address: str | None = Field(None, description="VISA resource; the virtual cell fills it in")
    options: dict[str, Any] = Field({}, description="keys of the driver's own settings")


class CameraTable(Section):
    """Depth camera."""

    driver: str | None = Field(None, description="none: the virtual cell's camera, or views put into 1-views by hand")
    views: int = Field(5, ge=1, le=60, description="views to take")
    options: dict[str, Any] = Field({}, description="keys of the driver's own settings")


class AlignmentTable(Section):
    """Where the part lies on the stage, when it is known: the corner's stage reading and the yaw."""

    x_mm: float
    y_mm: float
    z_mm: float = Field(description="stage reading at which the coil touches the level of the part's bottom")
    yaw_deg: float = Field(0.0, ge=-180, le=180)
    pitch_deg: float = Field(0.0, ge=-10, le=10)
    roll_deg: float = Field(0.0, ge=-10, le=10)

    def T_stage_part(self) -> Array:
        """Return the pose (4, 4)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_euler("ZYX", [self.yaw_deg, self.pitch_deg, self.roll_deg], degrees=True)
        return transform(turn.as_matrix(), (self.x_mm, self.y_mm, self.z_mm))


class ReferenceTable(Section):
    """Reference block that stays on the stage, its notches across x."""

    x_mm: float = Field(description="corner of its top with the least x and y [stage]")
    y_mm: float
    z_mm: float = Field(description="stage reading at which the coil touches its top")
    length_mm: float = Field(80.0, gt=0, description="along x")
    width_mm: float = Field(16.0, gt=0, description="along y")
    notch_x_mm: tuple[float, ...] = Field((20.0, 40.0, 60.0), description="places of the notches from the corner")
    notch_depths_mm: tuple[float, ...] = (0.2, 0.5, 1.0)
    notch_length_mm: float = Field(5.0, gt=0)
    conductivity_ms_m: float = Field(19.0, gt=0.1, le=65.0)


class RigSettings(Section):
    """The whole of rig.toml."""

    stage: StageTable = StageTable()
    instrument: InstrumentTable = InstrumentTable()
    camera: CameraTable = CameraTable()
    alignment: AlignmentTable | None = Field(None, description="table with x_mm, y_mm, z_mm, yaw_deg if known")
    reference: ReferenceTable | None = Field(None, description="table with x_mm, y_mm, z_mm of a reference block")
    world: WorldSettings | None = Field(None, description="the virtual cell; leave out for a real rig")

    @property
    def travel_mm(self) -> tuple[float, float, float]:
        """Return the x, y, z travels the plan has to fit into [mm]."""
        return self.stage.travel_mm


def virtual_rig(part: str = "block-a", seed: int = 1, *, tilt_axis: Literal["none", "a", "b"] = "none") -> RigSettings:
    """Return the settings of a virtual cell with one named part.

    Parameters
    ----------
    part, seed
        What lies in the cell.
    tilt_axis
        A fourth axis that turns the probe about the stage's x (a) or y (b).

    Raises
    ------
    InputError
        When the part is unknown.
    """
    named_part(part)
    world = WorldSettings(part=part, seed=seed, stage=WorldStage(tilt_axis=tilt_axis))
    stage = StageTable() if tilt_axis == "none" else StageTable(options={"axes": _axes_with_tilt(tilt_axis)})
    return RigSettings(stage=stage, reference=_reference_of(world), world=world)


def _axes_with_tilt(name: str) -> list[dict[str, Any]]:
    from eddyscan.devices.drivers.zaber_settings import STUDY_CHAIN, ZaberAxis

    tilt = ZaberAxis(name=name, model="X-RSW60C", device=4, unit="deg", travel=120.0, lower=-60.0, microstep=0.0009375)
    return [axis.model_dump(exclude_defaults=True) for axis in (*STUDY_CHAIN, tilt)]


def _reference_of(world: WorldSettings) -> ReferenceTable:
    """Return the block as its drawing and the rig's fitter describe it; the true place is a little off."""
    block = world.reference
    count = len(block.notch_depths_mm)
    return ReferenceTable(
        x_mm=block.corner_mm[0],
        y_mm=block.corner_mm[1],
        z_mm=block.corner_mm[2],
        length_mm=block.size_mm[0],
        width_mm=block.size_mm[1],
        notch_x_mm=tuple((k + 1) * block.size_mm[0] / (count + 1) for k in range(count)),
        notch_depths_mm=block.notch_depths_mm,
        notch_length_mm=block.notch_length_mm,
        conductivity_ms_m=world.conductivity_ms_m,
    )


def rig_text(settings: RigSettings, heading: str = HEADING) -> str:
    """Return rig.toml with every key, its unit, limits and meaning."""
    return commented_toml(settings, heading)
