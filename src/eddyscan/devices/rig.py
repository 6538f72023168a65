"""The rig: what rig.toml names, opened lazily, closed together."""

from __future__ import annotations

import importlib
import logging
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, cast, get_type_hints

import numpy as np
from pydantic import BaseModel, ValidationError

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.devices.clock import ScaledClock, VirtualClock, WallClock
from eddyscan.devices.protocols import Clock, DepthCamera, EddyInstrument, Stage
from eddyscan.devices.rig_settings import RigSettings, rig_text, virtual_rig

if TYPE_CHECKING:
    from eddyscan.devices.sim.world import VirtualCell

__all__ = ["Rig", "RigSettings", "connect", "open_rig", "rig_text", "virtual_rig"]

LOG = logging.getLogger("eddyscan.devices")


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
        self.clock: Clock = WallClock() if world is None else _clock_of(world.time_factor)
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


def _clock_of(time_factor: float) -> Clock:
    """Return the cell's clock: virtual (repeatable, as fast as the computer) or so many times the wall's."""
    return ScaledClock(time_factor) if time_factor > 0 else VirtualClock()


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
