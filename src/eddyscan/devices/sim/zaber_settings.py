"""What the simulated Zaber controller is made of.

Travel, accuracy and microstep sizes of the two models are published figures
(203.2 mm and 60 um, 40 mm and 35 um; 0.047625 um and 0.09525 um); speeds,
accelerations, backlash and noise are PLACEHOLDERS until a stage was measured.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from eddyscan.core.technique import Section


class SimulatedAxis(Section):
    """One axis of the simulated stage."""

    name: str = "x"
    model: str = "X-LSM200A"
    serial_number: int = 101
    device_id: int = Field(99001, description="synthetic, so that no device database knows it")
    unit: Literal["mm", "deg"] = "mm"
    travel: float = Field(203.2, gt=0, description="[unit]")
    microstep: float = Field(47.625e-6, gt=0, description="[unit]")
    max_speed: float = Field(29.0, gt=0, description="[unit/s] PLACEHOLDER")
    acceleration: float = Field(200.0, gt=0, description="[unit/s^2] PLACEHOLDER")
    accuracy: float = Field(0.060, ge=0, description="[unit] peak-to-peak of the repeatable error over the travel")
    backlash: float = Field(0.003, ge=0, description="[unit] PLACEHOLDER")
    noise: float = Field(0.0002, ge=0, description="[unit] standard deviation, PLACEHOLDER")
    inverted: bool = Field(False, description="the stage reading falls as the controller's count rises")
    lower: float = Field(0.0, description="[unit] stage reading at the lower end of travel")
    start: float = Field(60.0, description="[unit] stage reading at power-up, unknown to the controller")


STUDY_AXES = (
    SimulatedAxis(),
    SimulatedAxis(name="y", serial_number=102),
    SimulatedAxis(
        name="z",
        model="X-VSR40A",
        serial_number=103,
        device_id=99002,
        travel=40.0,
        microstep=95.25e-6,
        max_speed=24.0,
        accuracy=0.035,
        inverted=True,
        start=25.0,
    ),
)


class GuessedFirmware(Section):
    """Behaviour nobody could check on hardware; each is a switch."""

    refuse_move_before_home: bool = Field(True, description="answer BADDATA to an absolute move without a reference")
    stop_sets_ni: bool = Field(True, description="a stop or a preempting command raises the warning NI")
    pvt_starvation: Literal["brake", "halt"] = Field("brake", description="what an axis does when its queue runs dry")
    pvt_queue: int = Field(100, ge=2, description="points a sequence can hold before it answers AGAIN")
    position_after_power_cycle: Literal["zero", "kept"] = "zero"
    bad_checksum_is_ignored: bool = True


class ZaberSettings(Section):
    """The simulated controller."""

    layout: Literal["chain", "mcc"] = Field("chain", description="one device per axis, or one with all axes")
    firmware: Literal["7.38", "6.28"] = "7.38"
    axes: tuple[SimulatedAxis, ...] = STUDY_AXES
    reply_delay_s: float = Field(
        0.001, ge=0, description="from a command's arrival to its whole answer; serial: 0.0043"
    )
    host: str = "127.0.0.1"
    seed: int = Field(1, ge=0, description="of the repeatable error map and the noise")
    guessed: GuessedFirmware = GuessedFirmware()
