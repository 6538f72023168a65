"""What one case of a campaign is made of, checked before the first one runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from eddyscan.campaign.design import Column
from eddyscan.core.errors import TechniqueError
from eddyscan.core.technique import Section

PREFIX = "flaw."


class SignalValues(Section):
    """One virtual field inspection: a flaw in a flat field, read and analysed."""

    model_config = ConfigDict(validate_default=True)

    flaw_length_mm: float = Field(1.0, gt=0.05, le=20)
    flaw_depth_mm: float = Field(0.33, gt=0.02, le=10)
    flaw_opening_mm: float = Field(0.1, ge=0, le=0.5)
    flaw_angle_deg: float | None = Field(None, description="none: any, drawn from the case's seed")
    noise: float = Field(1e-4, ge=0, le=0.05, description="white noise per reading over the air reactance")
    lift_off_mm: float = Field(0.2, gt=0, le=2)
    lift_off_sd_mm: float = Field(0.01, ge=0, le=0.5, description="error of the path, standard deviation")
    lift_off_correlation_mm: float = Field(10.0, gt=0, le=100)
    pitch_mm: float = Field(0.5, gt=0.05, le=5)
    step_mm: float = Field(0.5, gt=0.05, le=5)
    frequency_hz: float = Field(500e3, gt=0, le=20e6)
    coil_tolerance: float = Field(0.02, ge=0, le=0.1, description="largest relative error of each coil size")
    field_mm: float = Field(40.0, ge=20, le=200, description="side; the flaw's centre keeps 8 mm from the rim")

    @field_validator("flaw_opening_mm")
    @classmethod
    def _thin(cls, opening_mm: float, info: ValidationInfo) -> float:
        sizes = [info.data[name] for name in ("flaw_length_mm", "flaw_depth_mm") if name in info.data]
        if sizes and opening_mm > 0.5 * min(sizes):
            raise ValueError(
                f"wider than half the smaller of the flaw's length and depth ({0.5 * min(sizes):.3g} mm), no thin slot"
            )
        return opening_mm


def signal_names() -> set[str]:
    """Return the parameter names of CAMPAIGN.toml for depth = "signal"."""
    return {_outer(name) for name in SignalValues.model_fields}


def signal_cases(columns: Mapping[str, Column], seeds: Sequence[int], n: int) -> list[dict[str, Any]]:
    """Return one checked mapping per case: its number, its seed and its values.

    Raises TechniqueError naming the first impossible case, its parameter and the limit.
    """
    return [
        {"case": k, "seed": seeds[k], **_checked(k, {name: _plain(column[k]) for name, column in columns.items()})}
        for k in range(n)
    ]


def _checked(case: int, given: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return SignalValues.model_validate({_inner(name): value for name, value in given.items()}).model_dump()
    except ValidationError as error:
        fault = error.errors()[0]
        name = _outer(str(fault["loc"][0]))
        raise TechniqueError(
            f"case {case} is impossible: {name} = {fault['input']!r}: {fault['msg']}. Narrow vary.{name}."
        ) from None


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _outer(name: str) -> str:
    return PREFIX + name.removeprefix("flaw_") if name.startswith("flaw_") else name


def _inner(name: str) -> str:
    return name.replace(PREFIX, "flaw_", 1)
