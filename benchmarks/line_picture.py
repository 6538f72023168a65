"""The README's strip: views, surface with path, lift-off map, planned against recorded positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

from eddyscan.core.frames import Array
from eddyscan.formats.plans import read_plan
from eddyscan.formats.record_ply import read_cscan_ply
from eddyscan.formats.records import read_record
from eddyscan.formats.views import read_views
from eddyscan.inspection import Inspection

VIEW_FROM = np.array([[0.86, 0.5, 0.0], [-0.28, 0.48, 0.83]])  # an oblique parallel projection, rows right and up


def draw(folder: Path, out: Path) -> None:
    """Draw the strip from a finished inspection folder."""
    inspection = Inspection(folder)
    view = read_views(inspection.view_files()[:1])[0]
    plan = read_plan(inspection.file("plan", "plan.json"))
    cscan = read_cscan_ply(inspection.file("cscan", "cscan.ply"))
    record = read_record(inspection.file("record", "record.sqlite"))
    figure, axes = plt.subplots(1, 4, figsize=(15, 3.4), layout="constrained")
    axes[0].imshow(view.depth_mm, cmap="cividis")  # type: ignore[union-attr]
    axes[0].set_title("1 of 5 depth views")
    _surface(axes[1], cscan, None, "height z [mm]", "surface and scan path")
    path = plan.surface_mm[plan.is_scan] @ VIEW_FROM.T
    axes[1].plot(path[:, 0], path[:, 1], ".", color="#c2410c", markersize=1.6)
    _surface(axes[2], cscan, cscan.channels["lift_off_mm"], "lift-off read [mm]", "what the probe read")
    error_um = 1e3 * (record.stage_mm - record.target_mm)
    for k, name in enumerate("xyz"):
        axes[3].plot(error_um[:, k], lw=0.6, label=f"{name}: sd {error_um[:, k].std():.2f} µm")
    axes[3].set(title="recorded minus planned [µm]", xlabel="reading")
    axes[3].legend(fontsize=8)
    for axis in axes[:3]:
        axis.set_axis_off()
    figure.savefig(out, dpi=90)
    plt.close(figure)


def _surface(axis: Any, cscan: Any, values: Array | None, label: str, title: str) -> None:
    mesh = cscan.mesh
    step = max(1, len(mesh.faces) // 12_000)
    faces = mesh.faces[::step] if values is None else mesh.faces[:: max(1, step)]
    shown = mesh.vertices[:, 2] if values is None else values
    corners = (mesh.vertices @ VIEW_FROM.T)[faces]
    depth = (mesh.vertices @ np.array([0.4, -0.72, 0.55]))[faces].mean(axis=1)
    order = np.argsort(depth)
    known = np.isfinite(shown[faces])
    total = np.where(known, shown[faces], 0.0).sum(axis=1)
    colours = np.divide(total, known.sum(axis=1), out=np.full(len(faces), np.nan), where=known.any(axis=1))
    patches = PolyCollection(corners[order], array=colours[order], cmap="viridis", edgecolors="face", linewidths=0.6)
    axis.add_collection(patches)
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.set_title(title)
    axis.figure.colorbar(patches, ax=axis, label=label, shrink=0.7)
