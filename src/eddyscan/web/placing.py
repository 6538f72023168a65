"""Readings on their way to the page: where on the part, how far from its surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.errors import EddyscanError
from eddyscan.core.frames import Array, ComplexArray, IntArray, apply, checked_transform, invert
from eddyscan.core.record import Reading, ScanRecord
from eddyscan.core.technique import Technique
from eddyscan.inspection import Inspection, read_json

if TYPE_CHECKING:
    from eddyscan.physics.sound_response import SoundResponse

COLUMNS = ("row", "point", "time_s", "x_mm", "y_mm", "z_mm", "resistance_ohm", "reactance_ohm", "flag", "lift_off_mm")
DECIMALS = (0, 0, 3, 3, 3, 3, 9, 9, 0, 4)


class Placing:
    """Places readings of one folder's scan in the part frame and tells the coil's lift-off.

    The lift-off is read off the curve of sound metal at the planned tilt; the
    corrections that need the whole scan (curvature, drift) come with the analysis.
    """

    def __init__(self, folder: Path) -> None:
        self._inspection = Inspection(folder)
        self._T_part_stage: Array | None = None
        self._tilt_deg: dict[tuple[int, int], float] = {}
        self._response: SoundResponse | None = None

    def rows(self, readings: Sequence[Reading]) -> list[list[float]]:
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
        return self._placed(
            keys=np.stack([record.row, record.point], axis=1),
            time_s=record.time_s,
            stage_mm=record.stage_mm,
            impedance_ohm=record.impedance_ohm,
            flag=record.flag,
        )

    def _placed(
        self, *, keys: IntArray, time_s: Array, stage_mm: Array, impedance_ohm: ComplexArray, flag: IntArray
    ) -> Array:
        if self._T_part_stage is None:
            path = self._inspection.file("record", "alignment.json")
            self._T_part_stage = invert(checked_transform(read_json(path)["T_stage_part"], str(path)))
            self._learn_sound_metal()
        at = apply(self._T_part_stage, stage_mm)
        lift_off = self._lift_off_mm(keys, impedance_ohm)
        columns: list[Any] = [keys, time_s, at, impedance_ohm.real, impedance_ohm.imag, flag, lift_off]
        return np.column_stack(columns).astype(np.float64)

    def _lift_off_mm(self, keys: IntArray, impedance_ohm: ComplexArray) -> Array:
        lift_off = np.full(len(keys), np.nan)
        good = np.isfinite(impedance_ohm)
        if self._response is None or not good.any():
            return lift_off
        tilt = np.array([self._tilt_deg.get((int(row), int(point)), 0.0) for row, point in keys[good]])
        lift_off[good] = self._response.project(impedance_ohm[good], tilt).lift_off_mm
        return lift_off

    def _learn_sound_metal(self) -> None:
        from eddyscan.analysis.readings import air_reading
        from eddyscan.formats.plans import read_plan
        from eddyscan.formats.records import read_record

        try:
            plan = read_plan(self._inspection.file("plan", "plan.json"))
            scan = np.flatnonzero(plan.is_scan)
            self._tilt_deg = {(int(plan.row[k]), int(plan.point[k])): float(plan.tilt_deg[k]) for k in scan}
            air = air_reading(read_record(self._inspection.file("record", "record.sqlite")).meta)
            most = float(plan.tilt_deg[scan].max())
            self._response = _sound_metal(self._inspection.technique(), air, most)
        except EddyscanError:
            self._response = None  # the readings are shown without lift-off


def _sound_metal(technique: Technique, air_ohm: complex | None, largest_tilt_deg: float) -> SoundResponse:
    from eddyscan.physics import sound_response as curves

    coil = curves.technique_coil(technique)
    if air_ohm is not None:
        coil = curves.coil_by_air_reading(coil, air_ohm, technique.drive.frequency_hz)
    return curves.sound_response(
        coil,
        curves.technique_conductor(technique),
        technique.drive.frequency_hz,
        air_ohm=air_ohm,
        largest_lift_off_mm=2.0 * technique.analysis.lift_off_max_mm + 1.0,
        largest_tilt_deg=largest_tilt_deg,
    )
