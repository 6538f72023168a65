"""The study's figure 15 drawn by the planner: sampled points on block-a, beside the dome and the hole."""

from __future__ import annotations

import numpy as np

from benchmarks.planning_surfaces import truths
from benchmarks.validation_page import PICTURES
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.planning import plan

NAME = "planning-points.png"


def _planned(mesh: SurfaceMesh, strategy: str) -> ScanPlan:
    settings = {"strategy": strategy, "machine": "pose", "margin_mm": 0.0}
    return plan(mesh, Technique.model_validate({"plan": settings}), allow_gaps=True)


def draw_points() -> str:
    """Draw the plans and return the picture's name."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    hole = next(truth for truth in truths(n_samples=1000) if truth.name == "sinusoid with hole")
    dome = next(truth for truth in truths(n_samples=1000) if truth.name == "dome")
    shown = [
        ("block-a, adaptive (the study's)", _planned(named_part("block-a").top_mesh(1.0), "adaptive")),
        ("dome, geodesic", _planned(dome.mesh, "geodesic")),
        ("sinusoid with a 30 mm hole, geodesic", _planned(hole.mesh, "geodesic")),
    ]
    figure = plt.figure(figsize=(11.5, 3.8), dpi=66)
    for k, (title, result) in enumerate(shown, start=1):
        axes = figure.add_subplot(1, 3, k, projection="3d")
        scan = result.is_scan
        points, row = result.surface_mm[scan], result.row[scan]
        for number in np.unique(row):
            own = points[row == number]
            axes.plot(*own.T, color="0.7", linewidth=0.6)
        axes.scatter(*points.T, c=points[:, 2], s=3, cmap="viridis", depthshade=False)
        axes.set(title=f"{title}\n{result.n_scan} points, {result.n_rows} rows", xlabel="x mm", ylabel="y mm")
        axes.set_box_aspect(np.ptp(points, axis=0) + 1)
        axes.view_init(38, -62)
    figure.tight_layout()
    PICTURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURES / NAME)
    plt.close(figure)
    return NAME
