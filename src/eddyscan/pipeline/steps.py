"""The arrows of the line on an inspection folder, except the scan.

Each function reads earlier folders, writes its own as a whole and names its
inputs' hashes.
"""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.errors import FileError, InputError
from eddyscan.core.progress import Progress
from eddyscan.inspection import Inspection, read_json, write_json
from eddyscan.pipeline.alignment import kept_placing
from eddyscan.pipeline.files import (
    comparison_json,
    nominal_of,
    plan_summary,
    surface_summary,
    write_surface,
)
from eddyscan.pipeline.states import inputs_of

if TYPE_CHECKING:
    from eddyscan.devices.rig import Rig


def take_views(inspection: Inspection, rig: Rig, progress: Progress) -> None:
    """Take views with the rig's camera into 1-views."""
    from eddyscan.formats.depth_images import write_depth_image

    started = datetime.now(UTC)
    camera = rig.camera
    n_views = rig.settings.camera.views
    with inspection.writing("views", inputs_of(inspection, "views"), started) as folder:
        for number in range(n_views):
            progress("taking views", number, n_views)
            write_depth_image(camera.capture(), folder / f"view-{number}.png")
        progress("taking views", n_views, n_views)


def make_surface(inspection: Inspection, progress: Progress, *, single_view: bool = False) -> None:
    """Reconstruct the surface from 1-views into 2-surface."""
    from eddyscan.formats.views import read_views
    from eddyscan.surface import reconstruct

    files = inspection.view_files()
    if not files:
        folder = inspection.step_folder("views")
        raise FileError(f"{folder} holds no views; put .ply, .pcd, .xyz, .e57 or depth .png with camera.json there.")
    technique = inspection.technique()
    started, inputs = datetime.now(UTC), inputs_of(inspection, "surface")
    result = reconstruct(read_views(files), technique.surface, single_view=single_view, progress=progress)
    with inspection.writing("surface", inputs, started) as folder:
        write_surface(result, folder)
        figures = surface_summary(result)
        if technique.part.nominal is not None:
            figures["nominal"] = _against_nominal(inspection, result.mesh, technique.part.nominal, progress)
        write_json(folder / "summary.json", figures)


def _against_nominal(inspection: Inspection, mesh: Any, name: str, progress: Progress) -> dict[str, Any]:
    from eddyscan.surface import compare

    beside = inspection.folder / name
    nominal = nominal_of(str(beside) if beside.is_file() else name)
    return {"name": name} | comparison_json(compare(mesh, nominal, progress=progress))


def make_plan(inspection: Inspection, rig_travel_mm: tuple[float, float, float] | None, progress: Progress) -> None:
    """Plan on 2-surface/surface.ply into 3-plan."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.formats.plans import write_plan
    from eddyscan.planning import plan

    started, inputs = datetime.now(UTC), inputs_of(inspection, "plan")
    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    result = plan(mesh, inspection.technique(), travel_mm=rig_travel_mm, inputs=inputs, progress=progress)
    with inspection.writing("plan", inputs, started) as folder:
        write_plan(result, folder / "plan.json")
        write_plan(result, folder / "plan.csv")
        write_json(folder / "summary.json", plan_summary(result))


def analyse_record(inspection: Inspection, progress: Progress) -> None:
    """Map 4-record on the surface into 5-cscan and call indications."""
    from eddyscan.analysis import analyse
    from eddyscan.analysis.correction import corrected_surface, surface_correction
    from eddyscan.formats.meshes import read_mesh, write_mesh
    from eddyscan.formats.record_ply import write_cscan_ply
    from eddyscan.formats.records import read_record

    started, inputs = datetime.now(UTC), inputs_of(inspection, "cscan")
    technique, placing = inspection.technique(), kept_placing(inspection)
    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    mesh = mesh if placing is None else placing.mesh(mesh)
    record = read_record(inspection.file("record", "record.sqlite"))
    result = analyse(record, mesh, technique, progress=progress)
    by_probe = corrected_surface(mesh, surface_correction(record, result, mesh, technique))
    with inspection.writing("cscan", inputs, started) as folder:
        write_cscan_ply(result.cscan, folder / "cscan.ply")
        write_mesh(by_probe, folder / "surface-by-probe.ply")
        np.savez_compressed(folder / "readings.npz", lift_off_mm=result.lift_off_mm, residual_ohm=result.residual_ohm)
        write_json(folder / "indications.json", [asdict(indication) for indication in result.indications])
        write_json(folder / "summary.json", result.statistics)


def step_summary(inspection: Inspection, step: str) -> dict[str, Any]:
    """Return summary.json of a step, or an empty dict."""
    path = inspection.file(step, "summary.json")
    value = read_json(path) if path.is_file() else {}
    if not isinstance(value, dict):
        raise InputError(f"{path} holds no JSON object. Delete its folder and run the step again.")
    return value
