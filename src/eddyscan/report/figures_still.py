"""The 3-D view for paper: the surface seen obliquely, with the path on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.core.mesh import face_vectors
from eddyscan.report.content import ReportContent
from eddyscan.report.envelopes import sparse
from eddyscan.report.mesh_thinning import thinned
from eddyscan.report.theme import Theme, canvas

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_VERTICES = 25_000


def projected(points_mm: Array) -> tuple[Array, Array]:
    """Return (N, 2) picture coordinates and (N,) depth of an oblique parallel view, z up."""
    turn, lift = np.radians(-32.0), np.radians(35.0)
    x = points_mm[:, 0] * np.cos(turn) - points_mm[:, 1] * np.sin(turn)
    away = points_mm[:, 0] * np.sin(turn) + points_mm[:, 1] * np.cos(turn)
    return np.stack([x, away * np.sin(lift) + points_mm[:, 2] * np.cos(lift)], axis=1), away


def still_figure(content: ReportContent, theme: Theme) -> Figure:
    """Draw the surface as lit triangles, far ones first, and the path over them."""
    from matplotlib import colormaps
    from matplotlib.collections import PolyCollection

    assert content.mesh is not None
    mesh = content.mesh
    keep, faces = thinned(mesh, MOST_VERTICES)
    vertices = mesh.vertices[keep]
    flat, away = projected(vertices)
    order = np.argsort(-away[faces].mean(axis=1))
    faces = faces[order]
    normal = face_vectors(vertices, faces)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = np.clip(0.35 + 0.65 * normal @ np.array([-0.35, -0.45, 0.82]), 0.2, 1.0)
    height = vertices[faces][:, :, 2].mean(axis=1)
    colour = colormaps["viridis"]((height - height.min()) / max(float(np.ptp(height)), 1e-9))
    colour[:, :3] *= light[:, None]
    figure, axes = canvas(height_in=4.0)
    axes.add_collection(
        PolyCollection(list(flat[faces]), facecolors=colour, edgecolors=colour, lw=0.3, rasterized=True)
    )
    if content.plan is not None:
        scan = content.plan.T_part_probe[content.plan.is_scan, :3, 3]
        line, _ = projected(scan[sparse(len(scan))])
        axes.plot(line[:, 0], line[:, 1], color=theme.second, lw=0.5)
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()
    return figure
