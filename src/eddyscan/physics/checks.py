"""Checks of given numbers: every refusal names the key, the value, the allowed range and the way out."""

from __future__ import annotations

import math

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array

CONDUCTIVITY_MAX_MS_M = 65.0


def positive(name: str, value: float, *, unit: str) -> None:
    """Raise TechniqueError unless `value` is finite and above 0."""
    if not math.isfinite(value) or value <= 0:
        raise TechniqueError(f"{name} = {value:g} {unit}: must be finite and greater than 0 {unit}.")


def conductivity(name: str, value_ms_m: float) -> None:
    """Raise TechniqueError unless `value_ms_m` is a plausible conductivity [MS/m]; name the likely unit slip."""
    if math.isfinite(value_ms_m) and 0 <= value_ms_m <= CONDUCTIVITY_MAX_MS_M:
        return
    hint = ""
    if 1e4 <= value_ms_m <= 1e6 * CONDUCTIVITY_MAX_MS_M:
        hint = f" This looks like S/m: {value_ms_m:g} S/m is {value_ms_m / 1e6:g} MS/m."
    elif CONDUCTIVITY_MAX_MS_M < value_ms_m <= 112:
        hint = f" This looks like % IACS: {value_ms_m:g} % IACS is {0.58 * value_ms_m:.3g} MS/m."
    raise TechniqueError(
        f"{name} = {value_ms_m:g}: must lie from 0 to {CONDUCTIVITY_MAX_MS_M:g} MS/m (silver has 63).{hint}"
    )


def lift_offs(lift_off_mm: Array, *, least_mm: float = 0.0, reason: str = "the coil would cut into the part") -> None:
    """Raise TechniqueError when a lift-off is below `least_mm` or not finite."""
    if lift_off_mm.size == 0 or (np.isfinite(lift_off_mm).all() and lift_off_mm.min() >= least_mm):
        return
    flat = lift_off_mm.ravel()
    worst = int(np.argmin(np.where(np.isfinite(flat), flat, -np.inf)))
    raise TechniqueError(
        f"lift_off_mm = {flat[worst]:g} at reading {worst} of {flat.size}: must be finite and at least "
        f"{least_mm:g} mm ({reason})."
    )
