"""The steps on single files: views to mesh, mesh to plan, mesh against nominal, export."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eddyscan.core import technique as models
from eddyscan.core.errors import FileError, InputError
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import PARTS, NominalPart
from eddyscan.core.plan import ScanPlan
from eddyscan.core.progress import Progress, silent
from eddyscan.core.registration import Registration
from eddyscan.inspection import checked_model, read_toml, sha256_of, write_json

if TYPE_CHECKING:
    from eddyscan.surface import Comparison, Deviation, Reconstruction

PLAN_SUFFIXES = (".csv", ".json")


def surface_settings(technique_file: Path | None, given: Mapping[str, Any]) -> models.Surface:
    """Return the [surface] table of a technique file, or one from the command's options."""
    if technique_file is not None:
        return read_toml(technique_file, models.Technique).surface
    return checked_model(given, models.Surface, "surface options")


def surface_from_views(
    views: Sequence[Path],
    out: Path,
    settings: models.Surface,
    *,
    single_view: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Reconstruct a surface and write surface.ply and registration.json into `out`."""
    from eddyscan.formats.views import read_views
    from eddyscan.surface import reconstruct

    if out.exists() and not out.is_dir():
        raise FileError(f"--out {out} is a file; name a folder.")
    result = reconstruct(read_views(views), settings, single_view=single_view, progress=progress)
    out.mkdir(parents=True, exist_ok=True)
    write_surface(result, out)
    return surface_summary(result) | {"surface": str(out / "surface.ply")}


def write_surface(result: Reconstruction, folder: Path) -> None:
    """Write surface.ply, the merged cloud and registration.json."""
    from eddyscan.formats.clouds import write_cloud
    from eddyscan.formats.meshes import write_mesh

    write_mesh(result.mesh, folder / "surface.ply")
    write_cloud(result.cloud, folder / "cloud.ply")
    write_json(folder / "registration.json", registration_json(result))


def registration_json(result: Reconstruction) -> dict[str, Any]:
    """Return registration.json's content."""
    return {
        "views": [_view_entry(registration) for registration in result.registrations],
        "method": result.method,
        "warnings": list(result.warnings),
    }


def _view_entry(registration: Registration) -> dict[str, Any]:
    return {
        "file": registration.view,
        "T_part_view": registration.T_target_source.tolist(),
        "inlier_rmse_mm": registration.inlier_rmse_mm,
        "fitness": registration.fitness,
        "converged": registration.converged,
        "weak_directions": list(registration.weak_directions),
        "source": registration.source,
    }


def surface_summary(result: Reconstruction) -> dict[str, Any]:
    """Return the figures a person wants to see of a reconstruction."""
    mesh = result.mesh
    uncertainty = None if mesh.uncertainty_mm is None else float(sum(mesh.uncertainty_mm) / len(mesh.uncertainty_mm))
    return registration_json(result) | {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "area_mm2": mesh.area_mm2,
        "size_mm": (mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).tolist(),
        "mean_uncertainty_mm": uncertainty,
    }


def plan_technique(
    technique_file: Path | None, given: Mapping[str, Any], lift_off_mm: float | None = None
) -> models.Technique:
    """Return a technique whose [plan] holds the command's options."""
    base = models.Technique() if technique_file is None else read_toml(technique_file, models.Technique)
    data = base.model_dump()
    data["plan"] |= dict(given)
    if lift_off_mm is not None:
        data["scan"]["lift_off_mm"] = lift_off_mm
    return checked_model(data, models.Technique, "plan options")


def plan_on_mesh(
    mesh_file: Path,
    out: Path,
    technique: models.Technique,
    *,
    allow_gaps: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """Plan on a mesh file and write the plan as CSV or JSON by the name's ending."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.formats.plans import write_plan
    from eddyscan.planning import plan

    if out.suffix.lower() not in PLAN_SUFFIXES:
        raise InputError(f"--out {out}: a plan is written as {' or '.join(PLAN_SUFFIXES)}.")
    if not out.parent.is_dir():
        raise FileError(f"--out {out}: there is no folder {out.parent}. Make it first.")
    mesh = read_mesh(mesh_file)
    inputs = {mesh_file.name: sha256_of(mesh_file)}
    result = plan(mesh, technique, inputs=inputs, allow_gaps=allow_gaps, progress=progress)
    write_plan(result, out)
    return plan_summary(result) | {"plan": str(out)}


def plan_summary(plan: ScanPlan) -> dict[str, Any]:
    """Return the figures a person wants to see of a plan."""
    scanned = plan.is_scan
    coverage = plan.coverage
    return {
        "rows": plan.n_rows,
        "points": plan.n_scan,
        "poses": len(plan),
        "duration_s": plan.duration_s,
        "swept_coverage": coverage.swept,
        "largest_gap_mm": coverage.largest_gap_mm,
        "spacing_mm": list(coverage.spacing_mm),
        "row_distance_mm": list(coverage.row_distance_mm),
        "footprint_mm": coverage.footprint_mm,
        "uncovered": [
            {"reason": spot.reason, "area_mm2": spot.area_mm2, "centre_mm": spot.centre_mm}
            for spot in coverage.uncovered
        ],
        "tilt_deg": {"mean": float(plan.tilt_deg[scanned].mean()), "max": float(plan.tilt_deg[scanned].max())},
        "lift_off_mm": {"mean": float(plan.lift_off_mm[scanned].mean()), "max": float(plan.lift_off_mm[scanned].max())},
        "notes": list(plan.notes),
    }


def plan_rows(result: Mapping[str, Any]) -> list[list[str]]:
    """Return the rows of the plan's table for people."""
    spacing, rows = result["spacing_mm"], result["row_distance_mm"]
    return [
        ["rows, points", f"{result['rows']}, {result['points']}"],
        ["swept coverage", f"{100 * result['swept_coverage']:.2f} %"],
        ["largest gap to the path", f"{result['largest_gap_mm']:.2f} mm"],
        ["point spacing", f"{spacing[0]:.3f} / {spacing[1]:.3f} / {spacing[2]:.3f} mm"],
        ["row distance", f"{rows[0]:.3f} / {rows[1]:.3f} / {rows[2]:.3f} mm"],
        ["tilt mean, max", f"{result['tilt_deg']['mean']:.1f}, {result['tilt_deg']['max']:.1f} deg"],
        ["lift-off mean, max", f"{result['lift_off_mm']['mean']:.3f}, {result['lift_off_mm']['max']:.3f} mm"],
        ["duration", f"{result['duration_s']:.0f} s"],
        *[[f"not covered: {spot['reason']}", f"{spot['area_mm2']:.0f} mm2"] for spot in result["uncovered"]],
    ]


def nominal_of(name: str) -> NominalPart | SurfaceMesh:
    """Return a named part, or the mesh in the file of that name."""
    from eddyscan.formats.meshes import read_mesh

    if name in PARTS:
        return PARTS[name]
    if not Path(name).is_file():
        raise InputError(f"{name} is neither a mesh file nor a known part; known are {', '.join(PARTS)}.")
    mesh: SurfaceMesh = read_mesh(Path(name))
    return mesh


def compare_meshes(mesh_file: Path, to: str, *, align: bool = False, progress: Progress = silent) -> dict[str, Any]:
    """Return the deviation of a mesh from a nominal, in its own frame and after best fit."""
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.surface import compare

    result = compare(read_mesh(mesh_file), nominal_of(to), progress=progress)
    return comparison_json(result, align=align)


def comparison_json(result: Comparison, *, align: bool = False) -> dict[str, Any]:
    """Return the outer contract's deviation object: one frame on top, both by name."""
    own, fit = _deviation(result.own), _deviation(result.fit)
    return (fit if align else own) | {"own": own, "fit": fit}


def _deviation(deviation: Deviation) -> dict[str, Any]:
    return {
        "mean_abs_mm": deviation.mean_abs_mm,
        "rmse_mm": deviation.rmse_mm,
        "p95_mm": deviation.p95_mm,
        "max_mm": deviation.max_mm,
        "coverage": deviation.coverage,
        "aligned": deviation.aligned,
        "T_nominal_mesh": deviation.T_nominal_mesh.tolist(),
    }


def export(source: Path, format_name: str, out: Path) -> dict[str, Any]:
    """Write a plan, or the record of a folder, in another system's format."""
    from eddyscan.formats.plans import export_plan, read_plan
    from eddyscan.pipeline.records import export_inspection, export_record_file

    if not out.parent.is_dir():
        raise FileError(f"--out {out}: there is no folder {out.parent}. Make it first.")
    if source.is_dir():
        return export_inspection(source, format_name, out)
    if source.suffix == ".json":
        plan = read_plan(source)
        export_plan(plan, format_name, out)
        return {"format": format_name, "entries": len(plan), "file": str(out)}
    return export_record_file(source, format_name, out)
