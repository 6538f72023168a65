"""What was examined, in percent and on the map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors
from eddyscan.report.theme import Theme, canvas, map_axes, map_height_in

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def vertex_areas(mesh: SurfaceMesh) -> Array:
    """Return the surface each vertex stands for (V,) [mm^2]: a third of its faces."""
    thirds = np.linalg.norm(face_vectors(mesh.vertices, mesh.faces), axis=1) / 6.0
    return np.asarray(sum(np.bincount(mesh.faces[:, k], thirds, minlength=len(mesh.vertices)) for k in range(3)))


def examined_share(cscan: CScan) -> float:
    """Return the share (0-1) of the whole surface for which a reading speaks."""
    areas = vertex_areas(cscan.mesh)
    return float(areas[cscan.covered].sum() / max(areas.sum(), 1e-12))


def share_texts(share: float) -> tuple[str, str]:
    """Return examined and not examined as percentages that add up; the examined one is never rounded up."""
    tenths = math.floor(1000 * share + 1e-9)
    return f"{tenths / 10:.1f} %", f"{(1000 - tenths) / 10:.1f} %"


def coverage_figure(cscan: CScan, theme: Theme) -> Figure:  # noqa: ARG001 - every drawing takes a theme
    """Draw examined and not examined surface from above."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    figure, axes = canvas(height_in=map_height_in(cscan.mesh.vertices, 4.4, extra_in=1.35), width_in=4.4)
    mesh = cscan.mesh
    examined = cscan.covered[mesh.faces].all(axis=1)
    axes.tripcolor(
        mesh.vertices[:, 0],
        mesh.vertices[:, 1],
        mesh.faces,
        facecolors=examined.astype(float),
        cmap=ListedColormap(["#c8562a", "#2f8f83"]),
        vmin=0,
        vmax=1,
        rasterized=True,
    )
    examined_text, rest_text = share_texts(examined_share(cscan))
    patches = [
        Patch(color="#2f8f83", label=f"examined: {examined_text}"),
        Patch(color="#c8562a", label=f"not examined: {rest_text}"),
    ]
    map_axes(axes, "Examined surface, from above")
    axes.legend(handles=patches, loc="upper center", bbox_to_anchor=(0.5, -0.24), ncols=2)
    return figure
