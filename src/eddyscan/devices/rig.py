"""The rig: what rig.toml names, opened lazily, closed together."""

from __future__ import annotations

import importlib
import logging
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self, cast, get_type_hints

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from eddyscan.core.commented_toml import commented_toml
from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Section
from eddyscan.devices.clock import ScaledClock, WallClock
from eddyscan.devices.protocols import Clock, DepthCamera, EddyInstrument, Stage
from eddyscan.devices.sim.world_settings import WorldSettings, WorldStage

if TYPE_CHECKING:
    from eddyscan.devices.sim.world import VirtualCell

LOG = logging.getLogger("eddyscan.devices")
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


def open_rig(settings: RigSettings) -> Rig:
    """Return the rig; its devices connect on first use and close with the `with` block."""
    return Rig(settings)


class Rig:
    """Stage, instrument, camera and clock of one cell, real or virtual.

    Attributes
    ----------
    settings : RigSettings
    clock : Clock
        The only source of time.
    cell : VirtualCell or None
    notes : list of str
        What a person has to know, for example that a driver is unverified.
    """

    def __init__(self, settings: RigSettings) -> None:
        self.settings = settings
        self.notes: list[str] = []
        world = settings.world
        self.clock: Clock = WallClock() if world is None else ScaledClock(world.time_factor)
        self._cell: VirtualCell | None = None
        self._stage: Stage | None = None
        self._instrument: EddyInstrument | None = None
        self._camera: DepthCamera | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def cell(self) -> VirtualCell | None:
        """Return the virtual cell, made on first use; None on a real rig."""
        if self._cell is None and self.settings.world is not None:
            from eddyscan.devices.sim.world import VirtualCell

            self._cell = VirtualCell(self.settings.world, self.clock)
        return self._cell

    @property
    def stage(self) -> Stage:
        """Return the stage, connected on first use."""
        if self._stage is None:
            table = self.settings.stage
            address = table.address if self.cell is None else self.cell.start().stage
            self._stage = cast(Stage, self._connected("stage", table.driver, address, table.options))
        return self._stage

    @property
    def instrument(self) -> EddyInstrument:
        """Return the instrument, connected on first use."""
        if self._instrument is None:
            table = self.settings.instrument
            address = table.address if self.cell is None else self.cell.start().instrument
            device = self._connected("instrument", table.driver, address, table.options)
            self._instrument = cast(EddyInstrument, device)
        return self._instrument

    @property
    def camera(self) -> DepthCamera:
        """Return the camera; raises TechniqueError when the rig has none."""
        if self._camera is None:
            table = self.settings.camera
            if table.driver is not None:
                self._camera = cast(DepthCamera, self._connected("camera", table.driver, None, table.options))
            elif self.cell is not None:
                self._camera = self.cell.camera()
            else:
                raise TechniqueError(
                    "rig.toml names no [camera] driver. Put views (.ply, .pcd, .xyz, .e57, or depth .png with "
                    "camera.json) into 1-views, or name a driver."
                )
        return self._camera

    def alignment(self, surface: SurfaceMesh | None = None) -> tuple[Array, str]:
        """Return T_stage_part (4, 4) and where it comes from.

        Parameters
        ----------
        surface : SurfaceMesh or None
            The reconstruction whose origin corner the operator jogs to; in the
            virtual cell it tells whether the part's ends are exchanged.
        """
        if self.settings.alignment is not None:
            return self.settings.alignment.T_stage_part(), "rig.toml [alignment]"
        if self.cell is not None:
            placing = self.cell.settings.placement.alignment
            return np.asarray(self.cell.rough_alignment(surface)), f"the virtual operator's jog ({placing})"
        raise TechniqueError(
            "where the part lies on the stage is not known. Jog to its corner with `eddyscan jog`, "
            "or give [alignment] x_mm, y_mm, z_mm in rig.toml."
        )

    def close(self) -> None:
        """Close whatever was opened, the stage first."""
        for device in (self._stage, self._instrument, self._camera, self._cell):
            if device is not None:
                device.close()
        self._stage = self._instrument = self._camera = self._cell = None

    def _connected(self, kind: str, driver: str, address: str | None, options: dict[str, Any]) -> object:
        device = connect(kind, driver, address, options, clock=self.clock)
        identity = cast(Any, device).identity()
        if not identity.verified and self.settings.world is None:
            note = (
                f"{kind} driver {driver} is unverified: nobody has reported running it on hardware. Stay near the stop."
            )
            self.notes.append(note)
            LOG.warning(note)
        return device


def connect(kind: str, driver: str, address: str | None, options: dict[str, Any], *, clock: Clock) -> object:
    """Make the device that `driver` = "module:Class" names.

    A class whose first argument is a settings model gets its options checked by
    that model; any other gets them as keywords. Both get the rig's clock.

    Raises
    ------
    TechniqueError
        When the class cannot be found or refuses an option.
    """
    maker = _driver_class(kind, driver)
    model = get_type_hints(maker.__init__).get("settings")
    given = dict(options)
    if not (isinstance(model, type) and issubclass(model, BaseModel)):
        return maker(**given, **({"address": address} if address else {}), clock=clock)
    given |= _address_keys(model, address)
    try:
        settings = model.model_validate(given)
    except ValidationError as fault:
        wrong = "; ".join(
            f"{'.'.join(str(place) for place in e['loc']) or 'table'}: {e['msg']} (given {e['input']!r})"
            for e in fault.errors()
        )
        keys = ", ".join(model.model_fields)
        raise TechniqueError(f"rig.toml [{kind}] does not fit {driver}: {wrong}. Its keys are {keys}.") from None
    return maker(settings, clock)


def _driver_class(kind: str, driver: str) -> Any:
    module_name, _, class_name = driver.partition(":")
    try:
        return getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError, ValueError) as fault:
        raise TechniqueError(
            f'rig.toml [{kind}] driver = "{driver}" cannot be loaded: {fault}. '
            'Write driver = "package.module:Class" of an installed package.'
        ) from fault


def _address_keys(model: type[BaseModel], address: str | None) -> dict[str, Any]:
    """Return the address as the model's own keys: address, or host and port, or serial_port."""
    if address is None:
        return {}
    if "address" in model.model_fields:
        return {"address": address}
    if address.startswith("tcp://"):
        host, _, port = address.removeprefix("tcp://").partition(":")
        return {"host": host} | ({"port": port} if port else {})
    return {"serial_port": address}
