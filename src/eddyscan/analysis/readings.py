"""The readings that can be used: flags, frequency and the air reading looked at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array, BoolArray, ComplexArray, IntArray
from eddyscan.core.record import OUT_OF_RANGE, OVERLOAD, POSITION_DOUBTFUL, ScanRecord
from eddyscan.physics import Coil

LEAST_READINGS = 5
FREQUENCY_TOLERANCE = 1e-3

FLAG_NAMES = {OVERLOAD: "overload", OUT_OF_RANGE: "out of range", POSITION_DOUBTFUL: "position doubtful"}


@dataclass(frozen=True)
class Readings:
    """The usable readings of a record.

    Attributes
    ----------
    index : (M,) int64
        Where each stands in the record.
    row : (M,) int64
    time_s : (M,) [s]
    part_mm : (M, 3) centre of the coil face [mm, part]
    impedance_ohm : (M,) complex [ohm], as read
    axis : (3,)
        Direction of the probe (out of the coil face, into the part) [part] of a
        machine that cannot tilt.
    air_ohm : complex or None
        What the instrument read with the coil in air.
    coil : Coil or None
        As calibrated before the scan.
    conductivity_ms_m : float or None
        Of the metal, found with the coil.
    """

    index: IntArray
    row: IntArray
    time_s: Array
    part_mm: Array
    impedance_ohm: ComplexArray
    axis: Array
    air_ohm: complex | None = None
    coil: Coil | None = None
    conductivity_ms_m: float | None = None

    def __len__(self) -> int:
        return len(self.index)


def usable(record: ScanRecord, frequency_hz: float) -> Readings:
    """Select what can be analysed.

    Parameters
    ----------
    record : ScanRecord
    frequency_hz : float [Hz]
        The technique's operating point; other channels are left out.

    Raises
    ------
    InputError
        When the record is empty, was read at another frequency, or fewer than
        `LEAST_READINGS` readings are without a flag.
    """
    if len(record) == 0:
        raise InputError("the record holds no reading. Run `eddyscan scan` on the inspection folder first.")
    at_frequency = np.abs(record.frequency_hz - frequency_hz) <= FREQUENCY_TOLERANCE * frequency_hz
    if not at_frequency.any():
        found = ", ".join(f"{f:.6g}" for f in np.unique(record.frequency_hz)[:5])
        raise InputError(
            f"no reading of the record was taken at the technique's {frequency_hz:.6g} Hz; it holds {found} Hz. "
            "Set drive.frequency_hz to one of these, or scan again."
        )
    good = at_frequency & (record.flag == 0) & _finite(record)
    if good.sum() < LEAST_READINGS:
        raise InputError(
            f"only {int(good.sum())} of {len(record)} readings can be used (at least {LEAST_READINGS} are needed): "
            f"{_losses(record, at_frequency)}. Look at the instrument and scan again."
        )
    index = np.flatnonzero(good)
    axis = -record.T_stage_part[2, :3]
    return Readings(
        index,
        record.row[good],
        record.time_s[good],
        record.part_mm[good],
        record.impedance_ohm[good],
        axis,
        air_reading(record.meta),
        *calibrated_coil(record.meta),
    )


def calibrated_coil(meta: dict[str, Any]) -> tuple[Coil | None, float | None]:
    """Return coil and conductivity from a record's `meta` under `coil`, None where it holds none."""
    value = meta.get("coil")
    if not isinstance(value, dict):
        return None, None
    keys = ("inner_radius_mm", "outer_radius_mm", "length_mm", "turns")
    sizes = [float(value[key]) for key in keys if isinstance(value.get(key), int | float)]
    missing = [key for key in keys if not isinstance(value.get(key), int | float)]
    if missing:
        raise InputError(f"the record's coil calibration lacks {', '.join(missing)}. Calibrate the coil again.")
    conductivity = value.get("conductivity_ms_m")
    return Coil(*sizes), float(conductivity) if isinstance(conductivity, int | float) else None


def air_reading(meta: dict[str, Any]) -> complex | None:
    """Return the air reading [ohm] of a record's `meta`, or None when it holds none.

    Accepted under the key `air`: a [resistance, reactance] pair, a table with
    `resistance_ohm` and `reactance_ohm`, or a complex number.
    """
    value = meta.get("air")
    if value is None:
        return None
    try:
        if isinstance(value, dict):
            value = (
                value["impedance_ohm"]
                if "impedance_ohm" in value
                else (value["resistance_ohm"], value["reactance_ohm"])
            )
        air = value if isinstance(value, complex) else complex(float(value[0]), float(value[1]))
    except (KeyError, TypeError, ValueError, IndexError):
        raise InputError(
            f"the record's air reading {value!r} is not a [resistance, reactance] pair in ohm. "
            "Read the coil in air again."
        ) from None
    if not (np.isfinite(air) and air.imag > 0):
        raise InputError(
            f"the record's air reading is {air:.4g} ohm; a coil in air has a positive reactance. "
            "Check the connection and read the coil in air again."
        )
    return air


def _finite(record: ScanRecord) -> BoolArray:
    return np.asarray(np.isfinite(record.impedance_ohm) & np.isfinite(record.stage_mm).all(axis=1))


def _losses(record: ScanRecord, at_frequency: BoolArray) -> str:
    counts = {name: int((record.flag & bit > 0).sum()) for bit, name in FLAG_NAMES.items()}
    counts["not a number"] = int((~_finite(record)).sum())
    counts["other frequency"] = int((~at_frequency).sum())
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count) or "the record is that short"
