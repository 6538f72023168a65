"""The scan step: align, check everything, then follow the plan and record."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan import __version__
from eddyscan.core.frames import Array, checked_transform
from eddyscan.core.progress import Progress
from eddyscan.inspection import Inspection, read_json, sha256_of, write_json, write_step_note
from eddyscan.pipeline.control import ScanControl, WatchedSink
from eddyscan.pipeline.states import inputs_of
from eddyscan.pipeline.truth import keep_truth_log

if TYPE_CHECKING:
    from eddyscan.core.mesh import SurfaceMesh
    from eddyscan.devices.rig import Rig


def scan_plan(
    inspection: Inspection, rig: Rig, *, dry_run: bool, progress: Progress, control: ScanControl | None = None
) -> None:
    """Follow 3-plan/plan.json into 4-record/record.sqlite; goes on where an earlier run stopped."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.formats.plans import read_plan
    from eddyscan.formats.records import SqliteRecord
    from eddyscan.scanning import check, run

    technique = inspection.technique()
    inputs = inputs_of(inspection, "record")
    _set_stale_record_aside(inspection, inputs)
    plan = read_plan(inspection.file("plan", "plan.json"))
    folder = inspection.step_folder("record")
    if not dry_run:
        folder.mkdir(exist_ok=True)
    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    T_stage_part = _alignment(inspection, rig, mesh, keep=not dry_run)
    check(plan, rig.stage.axes(), T_stage_part, technique, mesh=mesh)
    if dry_run:
        return
    write_json(folder / "inputs.json", inputs)
    started = datetime.now(UTC)
    inspection.log("scan", stage=str(rig.stage.identity()), instrument=str(rig.instrument.identity()))
    control = control or ScanControl()
    control.attach(rig.stage)
    sink = WatchedSink(SqliteRecord(folder / "record.sqlite"), control)
    try:
        for key, value in _settings_as_applied(inspection, rig, T_stage_part, inputs).items():
            sink.note(key, value)
        run(
            plan,
            stage=rig.stage,
            instrument=rig.instrument,
            clock=rig.clock,
            sink=sink,
            technique=technique,
            T_stage_part=T_stage_part,
            mesh=mesh,
            progress=progress,
        )
    finally:
        sink.close()
        if rig.cell is not None:
            keep_truth_log(inspection, rig.cell.truth_log())
    write_step_note(folder, inputs, started)


def _set_stale_record_aside(inspection: Inspection, inputs: dict[str, str]) -> None:
    begun = inspection.file("record", "inputs.json")
    if begun.is_file() and read_json(begun) != inputs:
        inspection.set_aside("record")


def _alignment(inspection: Inspection, rig: Rig, mesh: SurfaceMesh, *, keep: bool) -> Array:
    """Return T_stage_part: from an earlier start of this scan, rig.toml, or the operator's jog."""
    path = inspection.file("record", "alignment.json")
    if path.is_file():
        return checked_transform(read_json(path)["T_stage_part"], str(path))
    T_stage_part, how = rig.alignment(mesh)
    if keep:
        write_json(path, {"T_stage_part": np.asarray(T_stage_part).tolist(), "how": how})
    return T_stage_part


def _settings_as_applied(
    inspection: Inspection, rig: Rig, T_stage_part: Array, inputs: dict[str, str]
) -> dict[str, Any]:
    return {
        "software": f"eddyscan {__version__}",
        "technique": inspection.technique().model_dump(mode="json"),
        "T_stage_part": T_stage_part.tolist(),
        "inputs": inputs,
        "plan_sha256": sha256_of(inspection.file("plan", "plan.json")),
        "stage": _identity(rig.stage.identity()),
        "instrument": _identity(rig.instrument.identity()),
        "axes": [vars(axis) for axis in rig.stage.axes()],
    }


def _identity(identity: Any) -> dict[str, Any]:
    return {key: getattr(identity, key) for key in ("kind", "model", "serial", "firmware", "verified", "settings")}
