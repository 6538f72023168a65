"""The scan step: find the part, check everything, follow the plan and record; coarse, then corrected."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan import __version__
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import ScanPlan
from eddyscan.core.progress import Progress
from eddyscan.core.technique import Technique
from eddyscan.inspection import Inspection, read_json, sha256_of, write_json, write_step_note
from eddyscan.pipeline.alignment import Placing, kept_placing, measured_placing, operators_placing
from eddyscan.pipeline.control import ScanControl, WatchedSink
from eddyscan.pipeline.states import inputs_of
from eddyscan.pipeline.truth import keep_truth_log

if TYPE_CHECKING:
    from eddyscan.devices.rig import Rig

COARSE, FINE, COARSE_LIFT_OFF = "plan-coarse.json", "plan-fine.json", "coarse-lift-off.npz"


def scan_plan(
    inspection: Inspection, rig: Rig, *, dry_run: bool, progress: Progress, control: ScanControl | None = None
) -> None:
    """Follow 3-plan/plan.json into 4-record/record.sqlite; goes on where an earlier run stopped."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.formats.plans import read_plan
    from eddyscan.scanning import check

    technique, inputs = inspection.technique(), inputs_of(inspection, "record")
    _set_stale_record_aside(inspection, inputs)
    plan = read_plan(inspection.file("plan", "plan.json"))
    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    if dry_run:
        placing = kept_placing(inspection) or operators_placing(inspection, rig, mesh)
        check(placing.plan(plan), rig.stage.axes(), placing.T_stage_part, technique, mesh=placing.mesh(mesh))
        return
    started, folder = datetime.now(UTC), inspection.step_folder("record")
    folder.mkdir(exist_ok=True)
    write_json(folder / "inputs.json", inputs)
    control = control or ScanControl()
    control.attach(rig.stage)
    try:
        placing = kept_placing(inspection) or measured_placing(inspection, rig, mesh, technique, progress)
        _Passes(inspection, rig, technique, placing, control, progress).scan(plan, mesh)
    finally:
        if rig.cell is not None:
            keep_truth_log(inspection, rig.cell.truth_log())
    write_step_note(folder, inputs, started)


def _set_stale_record_aside(inspection: Inspection, inputs: dict[str, str]) -> None:
    begun = inspection.file("record", "inputs.json")
    if begun.is_file() and read_json(begun) != inputs:
        inspection.set_aside("record")


class _Passes:
    """The passes of one record: one, or a coarse one and the fine one it corrects."""

    def __init__(
        self,
        inspection: Inspection,
        rig: Rig,
        technique: Technique,
        placing: Placing,
        control: ScanControl,
        progress: Progress,
    ) -> None:
        self._inspection, self._rig, self._technique = inspection, rig, technique
        self._placing, self._control, self._progress = placing, control, progress

    def scan(self, plan: ScanPlan, mesh: SurfaceMesh) -> None:
        """Do every pass that the record does not hold in full."""
        plan, mesh = self._placing.plan(plan), self._placing.mesh(mesh)
        if self._technique.scan.passes == 1:
            self._follow(plan, mesh, 0)
            return
        self._follow(self._coarse_plan(plan, mesh), mesh, 0)
        self._follow(self._fine_plan(plan, mesh), mesh, 1)

    def _follow(self, plan: ScanPlan, mesh: SurfaceMesh, number: int) -> None:
        from eddyscan.formats.records import SqliteRecord
        from eddyscan.scanning import run

        rig = self._rig
        sink = WatchedSink(SqliteRecord(self._file("record.sqlite"), scan_pass=number), self._control)
        try:
            if number == 1 and sink.done() >= _points(plan):
                return
            for key, value in self._settings_as_applied().items():
                sink.note(key, value)
            run(
                plan,
                stage=rig.stage,
                instrument=rig.instrument,
                clock=rig.clock,
                sink=sink,
                technique=self._technique,
                T_stage_part=self._placing.T_stage_part,
                mesh=mesh,
                progress=self._progress,
            )
        finally:
            sink.close()

    def _coarse_plan(self, plan: ScanPlan, mesh: SurfaceMesh) -> ScanPlan:
        """Return the coarse pass: rows `coarse_pitch_mm` apart, or the plan's when as coarse; raised, since untried."""
        from eddyscan.planning import plan as make_plan

        scan, wanted = self._technique.scan, self._technique.plan
        if wanted.pitch_mm >= scan.coarse_pitch_mm:
            return raised(plan, scan.coarse_lift_off_mm)
        wider = {"pitch_mm": scan.coarse_pitch_mm, "step_mm": max(wanted.step_mm, scan.coarse_pitch_mm)}
        coarse = self._technique.model_copy(update={"plan": wanted.model_copy(update=wider)})
        return self._kept(
            COARSE,
            lambda: raised(make_plan(mesh, coarse, allow_gaps=True, progress=self._progress), scan.coarse_lift_off_mm),
        )

    def _fine_plan(self, plan: ScanPlan, mesh: SurfaceMesh) -> ScanPlan:
        """Return the plan moved to where the coarse pass found the metal."""
        from eddyscan.analysis import analyse
        from eddyscan.analysis.correction import corrected_plan
        from eddyscan.formats.records import read_record

        def corrected() -> ScanPlan:
            record = read_record(self._file("record.sqlite"), scan_pass=0)
            result = analyse(record, mesh, self._technique, progress=self._progress)
            np.savez_compressed(self._file(COARSE_LIFT_OFF), lift_off_mm=result.lift_off_mm)
            return corrected_plan(plan, record, result, self._technique, mesh=mesh)

        return self._kept(FINE, corrected)

    def _kept(self, name: str, make: Any) -> ScanPlan:
        """Return the plan kept beside the record, made now if it is not there: a resumed scan follows the same one."""
        from eddyscan.formats.plans import read_plan, write_plan

        path = self._file(name)
        if not path.is_file():
            write_plan(make(), path)
        return read_plan(path)

    def _file(self, name: str) -> Path:
        return self._inspection.file("record", name)

    def _settings_as_applied(self) -> dict[str, Any]:
        details = self._placing.details
        calibration: dict[str, Any] = {key: details[key] for key in ("air", "coil") if key in details}
        return {
            "software": f"eddyscan {__version__}",
            "technique": self._technique.model_dump(mode="json"),
            "alignment": details,
            "inputs": inputs_of(self._inspection, "record"),
            "plan_sha256": sha256_of(self._inspection.file("plan", "plan.json")),
        } | calibration


def raised(plan: ScanPlan, by_mm: float) -> ScanPlan:
    """Return the plan with every pose drawn back along the probe's own axis."""
    T = plan.T_part_probe.copy()
    T[:, :3, 3] -= by_mm * T[:, :3, 2]
    return replace(plan, T_part_probe=T, lift_off_mm=plan.lift_off_mm + by_mm * np.cos(np.radians(plan.tilt_deg)))


def _points(plan: ScanPlan) -> set[tuple[int, int]]:
    scanned = plan.is_scan
    return set(zip(plan.row[scanned].tolist(), plan.point[scanned].tolist(), strict=True))
