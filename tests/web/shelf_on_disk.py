"""A small inspection on disk whose surface and plan are exact: what the page's tests open."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.formats.clouds import write_cloud
from eddyscan.formats.meshes import write_mesh
from eddyscan.formats.plans import write_plan
from eddyscan.inspection import Inspection, write_json
from eddyscan.pipeline import new_inspection
from eddyscan.pipeline.files import plan_summary
from eddyscan.pipeline.states import inputs_of
from eddyscan.planning import plan


def planned_inspection(
    folder: Path, *, part: str = "plate", pitch_mm: float = 20.0, step_mm: float = 10.0
) -> Inspection:
    """Make an inspection with views, surface and plan, as the steps would leave it."""
    inspection = new_inspection(folder, part=part)
    technique = Technique.model_validate(
        {"part": {"name": part, "nominal": part}, "plan": {"pitch_mm": pitch_mm, "step_mm": step_mm}}
    )
    inspection.technique_file.write_text(
        f'[part]\nname = "{part}"\nnominal = "{part}"\n[plan]\npitch_mm = {pitch_mm}\nstep_mm = {step_mm}\n'
    )
    mesh = named_part(part).top_mesh(5.0)
    for k in range(2):
        write_cloud(PointCloud(mesh.vertices + 100.0 * k), inspection.step_folder("views") / f"view-{k}.ply")
    views = [
        {
            "file": f"view-{k}.ply",
            "T_part_view": np.eye(4).tolist(),
            "inlier_rmse_mm": 0.021,
            "fitness": 0.8,
            "converged": True,
            "weak_directions": ["slides along y by +-6 mm"] if k else [],
            "source": "registered",
        }
        for k in range(2)
    ]
    with inspection.writing("surface", inputs_of(inspection, "surface")) as place:
        write_mesh(mesh, place / "surface.ply")
        write_cloud(PointCloud(mesh.vertices, "part"), place / "cloud.ply")
        write_json(place / "registration.json", {"views": views, "method": "auto", "warnings": []})
        size = (mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)).tolist()
        summary = {"views": views, "method": "auto", "warnings": ["a bolt stands close to the part"], "size_mm": size}
        summary |= {"vertices": len(mesh.vertices), "faces": len(mesh.faces), "area_mm2": mesh.area_mm2}
        write_json(place / "summary.json", summary | {"mean_uncertainty_mm": None})
    planned = plan(mesh, technique)
    with inspection.writing("plan", inputs_of(inspection, "plan")) as place:
        write_plan(planned, place / "plan.json")
        write_json(place / "summary.json", plan_summary(planned))
    return inspection


def behave(inspection: Inspection, **how: object) -> None:
    """Tell the line under test how to behave in this folder."""
    (inspection.folder / "behave.json").write_text(json.dumps(how))
