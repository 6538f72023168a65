"""What the instrument read and where: raw, unrotated, never changed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, ComplexArray, IntArray, apply, invert

OK, OVERLOAD, OUT_OF_RANGE, POSITION_DOUBTFUL = 0, 1, 2, 4


@dataclass(frozen=True)
class Reading:
    """One reading on its way to the record.

    Attributes
    ----------
    row, point : planned row and point it belongs to
    time_s : seconds since the scan began (the rig's clock)
    stage_mm : (3,) measured axis positions [mm, stage]
    frequency_hz : drive frequency
    impedance_ohm : complex, as read (e^{+j w t})
    flag : bit mask of OVERLOAD, OUT_OF_RANGE, POSITION_DOUBTFUL; 0 is good
    target_mm : (3,) commanded axis positions [mm, stage]
    """

    row: int
    point: int
    time_s: float
    stage_mm: tuple[float, float, float]
    frequency_hz: float
    impedance_ohm: complex
    flag: int
    target_mm: tuple[float, float, float]


@dataclass(frozen=True)
class ScanRecord:
    """All readings of a scan in the order they were taken.

    Attributes
    ----------
    row, point : (N,) int64
    time_s : (N,)
    stage_mm, target_mm : (N, 3) measured and commanded axes [mm, stage]
    frequency_hz : (N,)
    impedance_ohm : (N,) complex128
    flag : (N,) int64
    meta : dict
        Settings as applied, device identities, `T_stage_part` (4x4 list), the
        plan's hash, software version, `air` and reference readings, `events`.
    """

    row: IntArray
    point: IntArray
    time_s: Array
    stage_mm: Array
    target_mm: Array
    frequency_hz: Array
    impedance_ohm: ComplexArray
    flag: IntArray
    meta: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.row)
        for name in ("point", "time_s", "stage_mm", "target_mm", "frequency_hz", "impedance_ohm", "flag"):
            if len(getattr(self, name)) != n:
                raise GeometryError(f"record column {name} has {len(getattr(self, name))} entries, row has {n}.")

    def __len__(self) -> int:
        return len(self.row)

    @property
    def T_stage_part(self) -> Array:
        """Return the part's pose on the stage as aligned before the scan (4, 4)."""
        return np.asarray(self.meta["T_stage_part"], dtype=np.float64)

    @property
    def part_mm(self) -> Array:
        """Return the coil positions (N, 3) [mm, part]."""
        return apply(invert(self.T_stage_part), self.stage_mm)
