"""Chapters about the form of the part: views, surface, comparison with the nominal."""

from __future__ import annotations

from functools import partial

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.report.blocks import Block, Chart, Facts, Gallery, Note, Scene, Section, Table
from eddyscan.report.content import NominalComparison, ReportContent
from eddyscan.report.figures_still import still_figure
from eddyscan.report.figures_surface import deviation_figure, profile_figure, uncertainty_figure
from eddyscan.report.figures_views import view_picture
from eddyscan.report.scene import MOST_ROWS, scene_json
from eddyscan.report.tables import facts_of
from eddyscan.report.words import number


def views(content: ReportContent) -> Section:
    """Show what the camera saw and how well the views fit together."""
    blocks: list[Block] = []
    if content.views:
        pictures = tuple(view_picture(view) for view in content.views)
        blocks.append(Gallery(pictures, "Near is light, far is dark; empty where the camera saw nothing."))
    else:
        blocks.append(Note("No views are kept with this inspection.", "missing"))
    if content.registrations:
        rows = tuple(
            (
                r.view,
                r.source,
                number(1000 * r.inlier_rmse_mm, 3),
                f"{100 * r.fitness:.0f}",
                "yes" if r.converged else "no",
                "; ".join(r.weak_directions) or "none",
            )
            for r in content.registrations
        )
        columns = ("view", "pose", "inlier RMSE [µm]", "overlap [%]", "converged", "left open by the data")
        blocks.append(Table(columns, rows, "Registration of the views", frozenset({0, 1, 4, 5})))
    return Section("views", "Views", "", tuple(blocks))


def surface(content: ReportContent) -> Section:
    """Show the measured surface in 3-D, with path and C-scan."""
    if content.mesh is None:
        return Section("surface", "Surface", "", (Note("No surface was reconstructed.", "missing"),))
    mesh = content.mesh
    size = mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)
    lead = (
        f"{size[0]:.1f} × {size[1]:.1f} × {size[2]:.1f} mm, {mesh.area_mm2 / 100:.1f} cm² of surface, "
        f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles."
    )
    still = Chart(partial(still_figure, content), "The surface seen from the front, with the planned path.")
    caption = "Drag to turn, scroll to zoom. The menu changes what the colour shows; grey: not covered."
    if content.plan is not None and content.plan.n_rows > MOST_ROWS:
        caption += " The path is dense: click its name to show it."
    blocks: list[Block] = [Scene(scene_json(content), caption, still)]
    if mesh.uncertainty_mm is not None:
        blocks.append(
            Chart(partial(uncertainty_figure, mesh), "How well each spot of the surface is known.", half=True)
        )
        blocks.append(_uncertainty_facts(mesh.uncertainty_mm))
    return Section("surface", "Surface, path and C-scan", lead, tuple(blocks))


def _uncertainty_facts(uncertainty_mm: Array) -> Facts:
    known = 1000 * uncertainty_mm[np.isfinite(uncertainty_mm)]
    if known.size == 0:
        return Facts((("stated for", "no vertex"),), "Uncertainty of the surface")
    rows = [(f"{share} % of the vertices below", f"{np.percentile(known, share):.0f} µm") for share in (50, 90, 99)]
    return Facts((*rows, ("largest", f"{known.max():.0f} µm")), "Standard uncertainty along the normal")


def nominal(content: ReportContent) -> Section | None:
    """Compare with the nominal; without one, only the profile of the surface."""
    if content.mesh is None:
        return None
    if content.nominal is None:
        chart = Chart(partial(profile_figure, content.mesh, None), "Height along x.")
        text = "No nominal surface was given, so nothing is said about deviations from it."
        return Section("nominal", "Against the nominal", "", (Note(text, "missing"), chart))
    blocks: list[Block] = [
        Chart(
            partial(profile_figure, content.mesh, content.nominal),
            f"Height along x against nominal {content.nominal.name} at the same spots.",
        )
    ]
    signed = content.nominal.signed_mm
    if signed is not None:
        blocks.append(_deviation_chart(content.mesh, signed))
    blocks.append(_deviation_facts(content.nominal))
    return Section("nominal", "Against the nominal", "", tuple(blocks))


def _deviation_chart(mesh: SurfaceMesh, signed_mm: Array) -> Chart:
    return Chart(partial(deviation_figure, mesh, signed_mm), "Signed distance of every vertex to the nominal surface.")


def _deviation_facts(comparison: NominalComparison) -> Block:
    plain = {key: value for key, value in comparison.deviation.items() if not key.startswith("T_")}
    if not plain:
        return Note("The comparison holds no statistics.", "missing")
    return facts_of(plain, f"Deviation from {comparison.name}", wide=True)
