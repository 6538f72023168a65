"""Readings on their way to the page: where on the part, how far from its surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.errors import EddyscanError
from eddyscan.core.frames import Array, ComplexArray, IntArray, apply, checked_transform, invert
from eddyscan.core.record import Reading, ScanRecord
from eddyscan.inspection import Inspection, read_json

COLUMNS = ("row", "point", "time_s", "x_mm", "y_mm", "z_mm", "resistance_ohm", "reactance_ohm", "flag", "lift_off_mm")
DECIMALS = (0, 0, 3, 3, 3, 3, 9, 9, 0, 4)
Spots = dict[tuple[int, int], tuple[Array, Array]]


class Placing:
    """Places readings of one folder's scan in the part frame.

    Lift-off here is the one the axes tell: the measured position's distance from
    the plan's spot along its normal. What the coil tells comes with the analysis.
    """

    def __init__(self, folder: Path) -> None:
        self._inspection = Inspection(folder)
        self._T_part_stage: Array | None = None
        self._spots: Spots = {}

    def rows(self, readings: Sequence[Reading]) -> list[list[float | None]]:
        """Return one list per reading in the order of COLUMNS, rounded for the wire."""
        table = self._placed(
            keys=np.array([(r.row, r.point) for r in readings], dtype=np.int64),
            time_s=np.array([r.time_s for r in readings]),
            stage_mm=np.array([r.stage_mm for r in readings]),
            impedance_ohm=np.array([r.impedance_ohm for r in readings], dtype=np.complex128),
            flag=np.array([r.flag for r in readings], dtype=np.int64),
        )
        return [[round(value, digits) for value, digits in zip(row, DECIMALS, strict=True)] for row in table.tolist()]

    def table(self, record: ScanRecord) -> Array:
        """Return a record as (N, len(COLUMNS)), NaN where unknown."""
        keys = np.stack([record.row, record.point], axis=1)
        return self._placed(
            keys=keys,
            time_s=record.time_s,
            stage_mm=record.stage_mm,
            impedance_ohm=record.impedance_ohm,
            flag=record.flag,
        )

    def _placed(
        self, *, keys: IntArray, time_s: Array, stage_mm: Array, impedance_ohm: ComplexArray, flag: IntArray
    ) -> Array:
        if self._T_part_stage is None:
            self._T_part_stage, self._spots = self._alignment(), self._planned_spots()
        at = apply(self._T_part_stage, stage_mm)
        lift_off = np.array([self._lift_off(int(row), int(p), at[k]) for k, (row, p) in enumerate(keys)])
        columns: list[Any] = [keys, time_s, at, impedance_ohm.real, impedance_ohm.imag, flag, lift_off]
        return np.column_stack(columns).astype(np.float64)

    def _lift_off(self, row: int, point: int, at: Array) -> float:
        spot = self._spots.get((row, point))
        return float("nan") if spot is None else float((at - spot[0]) @ spot[1])

    def _alignment(self) -> Array:
        path = self._inspection.file("record", "alignment.json")
        return invert(checked_transform(read_json(path)["T_stage_part"], str(path)))

    def _planned_spots(self) -> Spots:
        from eddyscan.formats.plans import read_plan

        try:
            plan = read_plan(self._inspection.file("plan", "plan.json"))
        except EddyscanError:
            return {}
        scan = np.flatnonzero(plan.is_scan)
        return {(int(plan.row[k]), int(plan.point[k])): (plan.surface_mm[k], plan.normal[k]) for k in scan}
