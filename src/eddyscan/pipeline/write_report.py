"""The last arrow: everything the folder holds, into 6-report/report.html."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan import __version__
from eddyscan.core.errors import FileError
from eddyscan.core.indication import Indication
from eddyscan.core.progress import Progress
from eddyscan.core.registration import Registration
from eddyscan.core.technique import Technique
from eddyscan.inspection import Inspection, read_json, sha256_of
from eddyscan.pipeline.files import nominal_of
from eddyscan.pipeline.rigs import LazyRig
from eddyscan.pipeline.scan import COARSE_LIFT_OFF, FINE
from eddyscan.pipeline.states import OUTPUTS, inputs_of, states_of
from eddyscan.pipeline.steps import step_summary
from eddyscan.pipeline.truth import truth_of

if TYPE_CHECKING:
    from eddyscan.core.mesh import SurfaceMesh
    from eddyscan.report import NominalComparison, ReportContent


def write_report(inspection: Inspection, rig: LazyRig, progress: Progress, *, pdf: bool = False) -> None:
    """Render report.html, and report.pdf when asked for, from whatever steps there are."""
    from eddyscan.report import render_html, render_pdf

    started, inputs = datetime.now(UTC), inputs_of(inspection, "report")
    progress("report", 0, 2)
    content = report_content(inspection, rig)
    progress("report", 1, 2)
    with inspection.writing("report", inputs, started) as folder:
        (folder / "report.html").write_text(render_html(content), encoding="utf-8")
        if pdf:
            (folder / "report.pdf").write_bytes(render_pdf(content))
    progress("report", 2, 2)


def report_content(inspection: Inspection, rig: LazyRig) -> ReportContent:
    """Collect the nouns of an inspection folder for the report."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.report import ReportContent

    technique = inspection.technique()
    mesh_file = inspection.file("surface", "surface.ply")
    mesh = read_mesh(mesh_file) if mesh_file.is_file() else None
    surface = step_summary(inspection, "surface")
    return ReportContent(
        technique=technique,
        title=f"Eddy-current inspection of {technique.part.name}",
        date=_scan_date(inspection),
        simulated=rig.settings().world is not None,
        registrations=_registrations(inspection),
        mesh=mesh,
        nominal=None if mesh is None else _nominal(inspection, technique, mesh),
        plan=_plan(inspection),
        hashes=_hashes(inspection),
        software_version=__version__,
        truth=truth_of(inspection, rig),
        timings_s={state.name: state.seconds for state in states_of(inspection) if state.seconds is not None},
        notes=[*surface.get("warnings", []), *step_summary(inspection, "plan").get("notes", [])],
        views=_views(inspection),
        **_scanned(inspection),
    )


def _scanned(inspection: Inspection) -> dict[str, Any]:
    """Return record and analysis, as far as they belong together."""
    from eddyscan.formats.record_ply import read_cscan_ply
    from eddyscan.formats.records import read_record

    record_file = inspection.file("record", "record.sqlite")
    if not record_file.is_file():
        return {}
    record = read_record(record_file)
    arrays_file = inspection.file("cscan", "readings.npz")
    if not arrays_file.is_file():
        return {"record": record}
    with np.load(arrays_file) as arrays:
        lift_off_mm, residual_ohm = arrays["lift_off_mm"], arrays["residual_ohm"]
    if len(lift_off_mm) != len(record):
        return {"record": record}
    coarse = inspection.file("record", COARSE_LIFT_OFF)
    return {
        "record": record,
        "coarse_lift_off_mm": np.load(coarse)["lift_off_mm"] if coarse.is_file() else None,
        "cscan": read_cscan_ply(inspection.file("cscan", "cscan.ply")),
        "indications": _indications(inspection),
        "lift_off_mm": lift_off_mm,
        "residual_ohm": residual_ohm,
        "statistics": step_summary(inspection, "cscan"),
    }


def _indications(inspection: Inspection) -> list[Indication]:
    entries = read_json(inspection.file("cscan", "indications.json"))
    return [Indication(**{**entry, "centre_mm": tuple(entry["centre_mm"])}) for entry in entries]


def _registrations(inspection: Inspection) -> list[Registration]:
    path = inspection.file("surface", "registration.json")
    if not path.is_file():
        return []
    return [
        Registration(
            view=entry["file"],
            T_target_source=np.asarray(entry["T_part_view"], dtype=float),
            inlier_rmse_mm=entry["inlier_rmse_mm"],
            fitness=entry["fitness"],
            converged=entry["converged"],
            weak_directions=tuple(entry["weak_directions"]),
            source=entry["source"],
        )
        for entry in read_json(path)["views"]
    ]


def _views(inspection: Inspection) -> list[Any]:
    from eddyscan.formats.views import read_views

    try:
        return list(read_views(inspection.view_files()))
    except FileError:
        return []


def _plan(inspection: Inspection) -> Any:
    from eddyscan.formats.plans import read_plan

    paths = [inspection.file("record", FINE), inspection.file("plan", "plan.json")]
    return next((read_plan(path) for path in paths if path.is_file()), None)


def _nominal(inspection: Inspection, technique: Technique, mesh: SurfaceMesh) -> NominalComparison | None:
    from eddyscan.core.parts import NominalPart
    from eddyscan.report import NominalComparison
    from eddyscan.surface import compare

    name = technique.part.nominal
    if name is None:
        return None
    beside = inspection.folder / name
    nominal = nominal_of(str(beside) if beside.is_file() else name)
    result = compare(mesh, nominal)
    surface = nominal.top_mesh(2.0) if isinstance(nominal, NominalPart) else nominal
    figures = step_summary(inspection, "surface").get("nominal", {})
    return NominalComparison(
        name=name,
        surface=surface,
        T_nominal_mesh=result.fit.T_nominal_mesh,
        signed_mm=result.fit.signed_mm,
        deviation=figures.get("fit", {}),
    )


def _scan_date(inspection: Inspection) -> str | None:
    note = inspection.note("record") or inspection.note("surface")
    return None if note is None else datetime.fromisoformat(note["finished"]).strftime("%Y-%m-%d %H:%M UTC")


def _hashes(inspection: Inspection) -> dict[str, str]:
    files: list[Path] = [*inspection.view_files(), inspection.technique_file, inspection.rig_file]
    files += [inspection.file(step, name) for step, name in OUTPUTS.items() if step != "report"]
    return {str(path.relative_to(inspection.folder)): sha256_of(path) for path in files if path.is_file()}
