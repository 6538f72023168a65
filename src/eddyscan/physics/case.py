"""The signal case file: what a coil reads over a sound or slotted conductor, from one TOML file.

The keys and the answer's form are fixed in the outer contract (`eddyscan signal CASE.toml`).
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from eddyscan.core.errors import FileError, TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.physics import checks
from eddyscan.physics.coil import Coil, air_inductance_h
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.impedance import impedance_ohm
from eddyscan.physics.slot import Profile, Slot, slot_warnings
from eddyscan.physics.slot_solver import slot_change_ohm


class Table(BaseModel):
    """A table of a case file: frozen, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class CoilTable(Table):
    """[coil]."""

    inner_radius_mm: float = Field(gt=0)
    outer_radius_mm: float = Field(gt=0)
    length_mm: float = Field(gt=0)
    turns: float = Field(gt=0)

    @model_validator(mode="after")
    def _radii(self) -> CoilTable:
        if self.inner_radius_mm >= self.outer_radius_mm:
            raise ValueError(
                f"inner_radius_mm = {self.inner_radius_mm:g} must be below outer_radius_mm = {self.outer_radius_mm:g}"
            )
        return self


class DriveTable(Table):
    """[drive]."""

    frequency_hz: float = Field(gt=0, le=20e6)


class ConductorTable(Table):
    """[conductor]; without thickness_mm a half-space."""

    conductivity_ms_m: float = Field(gt=0)
    thickness_mm: float | None = Field(None, gt=0)
    relative_permeability: float = Field(1.0, gt=0, le=1e6)

    @field_validator("conductivity_ms_m")
    @classmethod
    def _plausible(cls, value: float) -> float:
        try:
            checks.conductivity("conductivity_ms_m", value)
        except TechniqueError as error:
            raise ValueError(str(error)) from error
        return value


class SlotShape(Table):
    """[slot]: surface-breaking, its length along x, its middle at x = y = 0."""

    length_mm: float = Field(gt=0)
    depth_mm: float = Field(gt=0)
    opening_mm: float = Field(ge=0)
    profile: Profile = "rectangular"


class ScanTable(Table):
    """[scan]: where the coil's axis stands; x along the slot."""

    lift_off_mm: float = Field(ge=0)
    x_mm: tuple[float, ...] = Field((0.0,), min_length=1)
    y_mm: tuple[float, ...] = Field((0.0,), min_length=1)

    @field_validator("x_mm", "y_mm", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        return (value,) if isinstance(value, int | float) else value

    @model_validator(mode="after")
    def _lengths(self) -> ScanTable:
        if len(self.y_mm) not in (1, len(self.x_mm)):
            raise ValueError(
                f"y_mm has {len(self.y_mm)} values: needed is one for all x or one per x ({len(self.x_mm)})"
            )
        return self

    @property
    def positions_mm(self) -> tuple[Array, Array]:
        """Coil positions x, y (N,), (N,) [mm, slot frame]."""
        x = np.asarray(self.x_mm, dtype=np.float64)
        return x, np.broadcast_to(np.asarray(self.y_mm, dtype=np.float64), x.shape)


class SignalCase(Table):
    """The whole case file."""

    coil: CoilTable
    drive: DriveTable
    conductor: ConductorTable
    scan: ScanTable
    slot: SlotShape | None = None

    @model_validator(mode="after")
    def _slot_fits(self) -> SignalCase:
        if self.slot is None:
            return self
        thickness = self.conductor.thickness_mm
        if thickness is not None and self.slot.depth_mm >= thickness:
            raise ValueError(
                f"slot.depth_mm = {self.slot.depth_mm:g} must be below conductor.thickness_mm = {thickness:g}"
            )
        return self

    @property
    def physical_coil(self) -> Coil:
        """The coil of this case."""
        return Coil(self.coil.inner_radius_mm, self.coil.outer_radius_mm, self.coil.length_mm, self.coil.turns)

    @property
    def physical_conductor(self) -> Conductor:
        """The conductor of this case."""
        metal = self.conductor
        if metal.thickness_mm is None:
            return Conductor.half_space(metal.conductivity_ms_m, metal.relative_permeability)
        return Conductor.plate(metal.conductivity_ms_m, metal.thickness_mm, metal.relative_permeability)


def parse_case(tables: dict[str, Any], *, name: str = "case") -> SignalCase:
    """Return the checked case, or raise TechniqueError that names each key, its value and the allowed range."""
    try:
        return SignalCase.model_validate(tables)
    except ValidationError as error:
        faults = "; ".join(_fault(dict(item)) for item in error.errors())
        raise TechniqueError(f"{name}: {faults}.") from error


def _fault(item: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in item["loc"])
    message = str(item["msg"]).removeprefix("Value error, ").rstrip(".")
    if item["type"] == "missing":
        return f"{key} is missing"
    if item["type"] == "extra_forbidden":
        return f"{key} is not a known key"
    if not key or (item["type"] == "value_error" and isinstance(item["input"], dict)):
        return f"{key}: {message}" if key else message
    if item["type"] == "value_error":
        return f"{key}: {message}"
    return f"{key} = {item['input']!r}: {message[:1].lower() + message[1:]}"


def read_case(path: Path) -> SignalCase:
    """Read a case file.

    Raises
    ------
    FileError
        The file is missing or is not TOML.
    TechniqueError
        A key is missing, unknown or out of range.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"cannot read the case file {path}: {error}. Give the path of a TOML file.") from error
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{path} is not valid TOML: {error}.") from error
    return parse_case(tables, name=path.name)


def solve_case(case: SignalCase) -> dict[str, Any]:
    """Return air, sound and slot signals of a case in the contract's JSON form, with what lies beyond validation."""
    coil, frequency = case.physical_coil, case.drive.frequency_hz
    omega = 2 * np.pi * frequency
    sound = complex(impedance_ohm(coil, case.physical_conductor, frequency, case.scan.lift_off_mm))
    x_mm, y_mm = case.scan.positions_mm
    change = slot_signal_ohm(case)
    rows = [
        {"x_mm": float(x), "y_mm": float(y), "dr_ohm": float(dz.real), "dl_h": float(dz.imag / omega)}
        for x, y, dz in zip(x_mm, y_mm, change, strict=True)
    ]
    return {
        "air": {"resistance_ohm": 0.0, "inductance_h": air_inductance_h(coil)},
        "sound": {"resistance_ohm": sound.real, "inductance_h": sound.imag / omega},
        "slot": rows if case.slot is not None else [],
        "warnings": list(case_warnings(case)),
    }


def case_slot(case: SignalCase) -> Slot | None:
    """Return the slot of a case, None for a sound conductor."""
    if case.slot is None:
        return None
    return Slot(case.slot.length_mm, case.slot.depth_mm, case.slot.opening_mm, case.slot.profile)


def case_warnings(case: SignalCase) -> tuple[str, ...]:
    """Return what of a case lies beyond the validated range, in words."""
    slot = case_slot(case)
    if slot is None:
        return ()
    return slot_warnings(slot, case.physical_conductor, case.drive.frequency_hz)


def slot_signal_ohm(case: SignalCase) -> ComplexArray:
    """Return the slot's change of impedance at every position of the case (N,) [ohm]; zero without a slot."""
    x_mm, y_mm = case.scan.positions_mm
    slot = case_slot(case)
    if slot is None:
        return np.zeros(x_mm.shape, dtype=np.complex128)
    return slot_change_ohm(
        slot,
        case.physical_coil,
        case.physical_conductor,
        case.drive.frequency_hz,
        x_mm=x_mm,
        y_mm=y_mm,
        lift_off_mm=case.scan.lift_off_mm,
    )
