"""How a lab's Zaber axes are wired: our own per-axis table, so no device database is needed.

Microstep sizes and travel are published figures of the two models; speeds and
accelerations are PLACEHOLDERS, replaced by what the device reports at connect.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from eddyscan.core.technique import Section


class ZaberAxis(Section):
    """One axis: where it is on the wire and how its counts become stage readings."""

    name: str
    model: str = "not stated"
    device: int = Field(1, ge=1, le=99, description="address on the chain")
    axis: int = Field(1, ge=1, le=9, description="number within its device")
    unit: Literal["mm", "deg"] = "mm"
    travel: float = Field(gt=0, description="[unit], cross-checked with the device's limit.max")
    microstep: float = Field(gt=0, description="[unit] per microstep")
    inverted: bool = Field(False, description="the stage reading falls as the device's count rises")
    lower: float = Field(0.0, description="[unit] stage reading at the lower end of travel")
    acceleration: float = Field(100.0, gt=0, description="[unit/s^2] used until the device tells its own")
    max_speed: float | None = Field(None, gt=0, description="[unit/s] cap below the device's own maxspeed")


STUDY_CHAIN = (
    ZaberAxis(name="x", model="X-LSM200A", device=1, travel=203.2, microstep=47.625e-6),
    ZaberAxis(name="y", model="X-LSM200A", device=2, travel=203.2, microstep=47.625e-6),
    ZaberAxis(name="z", model="X-VSR40A", device=3, travel=40.0, microstep=95.25e-6, inverted=True),
)


class ZaberStageSettings(Section):
    """How to reach the stage and how far to trust it."""

    host: str | None = Field(None, description="TCP address; leave out for a serial port")
    port: int = Field(55550, ge=1, le=65535)
    serial_port: str | None = Field(None, description="for example /dev/ttyUSB0")
    baud_rate: int = 115200
    axes: tuple[ZaberAxis, ...] = STUDY_CHAIN
    tolerance: float = Field(0.002, gt=0, description="[unit] largest distance to the target after a move")
    no_progress_s: float = Field(1.0, gt=0, description="a moving axis that covers nothing for so long is stopped")
    request_timeout_s: float = Field(1.0, gt=0, description="wall time the library waits for an answer")
    read_retries: int = Field(1, ge=0, le=5, description="a position request that got no answer is repeated")

    dead_man: bool = Field(True, description="a second process stops the axes when this one is killed")

    @model_validator(mode="after")
    def _one_way_in(self) -> ZaberStageSettings:
        if (self.host is None) == (self.serial_port is None):
            raise ValueError("give either host (TCP) or serial_port, not both and not neither")
        names = [axis.name for axis in self.axes]
        if len(set(names)) != len(names) or not names:
            raise ValueError(f"axis names must differ, they are {names}")
        return self

    @property
    def address(self) -> str:
        """Return the address as messages show it."""
        return f"{self.host}:{self.port}" if self.host else str(self.serial_port)
