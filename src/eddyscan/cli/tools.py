"""Commands on single files: surface, plan, compare, export, signal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from eddyscan.cli.terminal import emit_json, progress_bars, say, table
from eddyscan.core.errors import InputError

Json = typer.Option(False, "--json", help="Print one JSON object on standard output.")


def register(app: typer.Typer) -> None:
    """Add this module's commands."""
    app.command()(surface)
    app.command()(plan)
    app.command()(compare)
    app.command()(export)
    app.command()(signal)


def surface(
    views: list[Path] = typer.Argument(
        ..., help=".ply .pcd .xyz .e57, or depth .png beside camera.json", metavar="VIEW..."
    ),
    out: Path = typer.Option(..., "--out", help="Folder for surface.ply and registration.json.", metavar="DIR"),
    method: str = typer.Option("auto", "--method", help="auto, or study: the reference study's literal chain."),
    depth: int = typer.Option(5, "--poisson-depth", help="Octree depth of the Poisson step."),
    grid_mm: float = typer.Option(1.0, "--grid-mm", help="Edge length of the delivered mesh [mm]."),
    technique: Path | None = typer.Option(None, "--technique", help="technique.toml whose [surface] table holds."),
    single_view: bool = typer.Option(False, "--single-view", help="Accept one view."),
    json: bool = Json,
) -> None:
    """Turn views into a mesh of the part, registered without a guess."""
    from eddyscan import pipeline

    given = {"method": method, "poisson_depth": depth, "grid_mm": grid_mm}
    settings = pipeline.surface_settings(technique, given)
    with progress_bars() as progress:
        result = pipeline.surface_from_views(views, out, settings, single_view=single_view, progress=progress)
    rows = [
        [v["file"], f"{v['inlier_rmse_mm']:.3f}", f"{100 * v['fitness']:.0f} %", "; ".join(v["weak_directions"])]
        for v in result["views"]
    ]
    table("Views", ["view", "inlier RMSE mm", "overlap", "weak directions"], rows)
    size = f"{result['vertices']} vertices, {result['area_mm2']:.0f} mm2"
    say(f"surface: {result['surface']} ({size}, method {result['method']})")
    for warning in result["warnings"]:
        say(f"warning: {warning}")
    if json:
        emit_json(result)


def plan(
    mesh: Path = typer.Argument(..., help="Mesh [mm]: PLY, STL or OBJ.", metavar="MESH"),
    pitch_mm: float = typer.Option(5.0, "--pitch-mm", help="Row distance on the surface [mm]."),
    step_mm: float = typer.Option(5.0, "--step-mm", help="Point distance along a row [mm]."),
    margin_mm: float = typer.Option(0.0, "--margin-mm", help="Distance kept from the edge, on the surface [mm]."),
    machine: str = typer.Option("xyz", "--machine", help="xyz, xyz-tilt or pose."),
    strategy: str | None = typer.Option(None, "--strategy", help="geodesic, adaptive, grid or encircle."),
    density: str | None = typer.Option(None, "--density", help="constant or adaptive."),
    lift_off_mm: float | None = typer.Option(None, "--lift-off-mm", help="Coil to surface [mm]."),
    technique: Path | None = typer.Option(None, "--technique", help="technique.toml for everything not given here."),
    allow_gaps: bool = typer.Option(False, "--allow-gaps", help="Accept a plan below its technique's coverage."),
    out: Path = typer.Option(
        ..., "--out", help="FILE.csv: one line per point; FILE.json: the whole plan.", metavar="FILE"
    ),
    json: bool = Json,
) -> None:
    """Plan rows and points on a mesh, prove their coverage, write the plan."""
    from eddyscan import pipeline

    given: dict[str, Any] = {"pitch_mm": pitch_mm, "step_mm": step_mm, "margin_mm": margin_mm, "machine": machine}
    given |= {key: value for key, value in {"strategy": strategy, "density": density}.items() if value is not None}
    settings = pipeline.plan_technique(technique, given, lift_off_mm)
    with progress_bars() as progress:
        result = pipeline.plan_on_mesh(mesh, out, settings, allow_gaps=allow_gaps, progress=progress)
    table("Plan", ["quantity", "value"], pipeline.plan_rows(result))
    for note in result["notes"]:
        say(f"note: {note}")
    if json:
        emit_json(result)


def compare(
    mesh: Path = typer.Argument(..., metavar="MESH"),
    to: str = typer.Option(..., "--to", help="A named part or a mesh file.", metavar="PART-NAME|MESH"),
    align: bool = typer.Option(
        False, "--align/--no-align", help="Report the best fit first instead of the delivered frame."
    ),
    json: bool = Json,
) -> None:
    """State the deviation of a mesh from a nominal surface, in its own frame and after best fit."""
    from eddyscan import pipeline

    with progress_bars() as progress:
        result = pipeline.compare_meshes(mesh, to, align=align, progress=progress)
    keys = ["mean_abs_mm", "rmse_mm", "p95_mm", "max_mm", "coverage"]
    rows = [[name, *(f"{result[name][key]:.4f}" for key in keys)] for name in ("own", "fit")]
    table(f"{mesh} against {to}", ["frame", *(key.replace("_", " ") for key in keys)], rows)
    if json:
        emit_json(result)


def export(
    file: Path = typer.Argument(..., help="An inspection folder, a plan.json or a record.sqlite.", metavar="FILE"),
    format: str = typer.Option(
        ..., "--format", help="For records csv, nde, hdf5, ply; for plans csv, gcode, noether, ros, urscript, krl."
    ),
    out: Path = typer.Option(..., "--out", metavar="FILE"),
    json: bool = Json,
) -> None:
    """Write a plan or a record in another system's format."""
    from eddyscan import pipeline

    result = pipeline.export(file, format, out)
    say(f"wrote {out} ({result['format']}, {result['entries']} entries)")
    if json:
        emit_json(result)


def signal(
    case: Path = typer.Argument(..., help="A signal case (TOML).", metavar="CASE.toml"),
    sweep: str | None = typer.Option(None, "--sweep", help="frequency or lift-off: to choose an operating point."),
    plot: Path | None = typer.Option(
        None, "--plot", help="Write the impedance plane and the scan as a picture (.png, .svg, .pdf)."
    ),
    json: bool = Json,
) -> None:
    """Compute what a coil reads over a sound or slotted conductor."""
    from eddyscan import pipeline

    if sweep not in (None, "frequency", "lift-off"):
        raise InputError(f"--sweep {sweep}: can be frequency or lift-off.")
    with progress_bars() as progress:
        result = pipeline.signal(case, sweep=sweep, plot=plot, progress=progress)
    table(f"{case}", *pipeline.signal_table(result))
    for warning in result.get("warnings", []):
        say(f"warning: {warning}")
    if plot:
        say(f"picture: {plot}")
    if json:
        emit_json(result)
