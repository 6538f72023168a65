"""A small inspection on disk whose surface and plan are exact: what the page's tests open."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.cscan import CScan
from eddyscan.core.indication import Indication
from eddyscan.core.parts import named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.record import Reading
from eddyscan.core.technique import Technique
from eddyscan.formats.clouds import write_cloud
from eddyscan.formats.meshes import read_mesh, write_mesh
from eddyscan.formats.plans import read_plan, write_plan
from eddyscan.formats.record_ply import write_cscan_ply
from eddyscan.formats.records import SqliteRecord
from eddyscan.inspection import Inspection, write_json, write_step_note
from eddyscan.pipeline import new_inspection
from eddyscan.pipeline.files import plan_summary
from eddyscan.pipeline.states import inputs_of
from eddyscan.planning import plan

SPOTS = ((100.0, 50.0), (160.0, 70.0))


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


def analysed_inspection(folder: Path) -> Inspection:
    """Make an inspection that was scanned and analysed: one indication at 100, 50 mm and one at 160, 70 mm."""
    inspection = planned_inspection(folder)
    planned = read_plan(inspection.file("plan", "plan.json"))
    scan = np.flatnonzero(planned.is_scan)
    at = planned.T_part_probe[scan, :3, 3]
    inspection.step_folder("record").mkdir()
    write_json(inspection.file("record", "alignment.json"), {"T_stage_part": np.eye(4).tolist(), "how": "as told"})
    write_json(inspection.file("record", "inputs.json"), inputs_of(inspection, "record"))
    sink = SqliteRecord(inspection.file("record", "record.sqlite"))
    bump = sum(np.exp(-(np.hypot(at[:, 0] - x, at[:, 1] - y) ** 2) / 50.0) for x, y in SPOTS)
    sink.write([_reading(k, planned, scan, at, complex(0.1, 0.2) * bump[k]) for k in range(len(scan))])
    sink.close()
    write_step_note(inspection.step_folder("record"), inputs_of(inspection, "record"), datetime.now(UTC))
    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    score = sum(
        20 * np.exp(-(np.hypot(mesh.vertices[:, 0] - x, mesh.vertices[:, 1] - y) ** 2) / 50.0) for x, y in SPOTS
    )
    channels = {"score": score, "lift_off_mm": np.full(len(score), 0.5)}
    with inspection.writing("cscan", inputs_of(inspection, "cscan")) as place:
        write_cscan_ply(CScan(mesh, np.ones(len(score), dtype=bool), channels), place / "cscan.ply")
        np.savez(place / "readings.npz", lift_off_mm=np.full(len(scan), 0.5), residual_ohm=complex(0.1, 0.2) * bump)
        called = [
            Indication(k + 1, (x, y, 30.0), 8.0, 15.0, 0.22, 63.4, 20.0 - 5 * k, length_mm=None, depth_mm=None)
            for k, (x, y) in enumerate(SPOTS)
        ]
        write_json(place / "indications.json", [asdict(one) for one in called])
        write_json(place / "summary.json", {"lift_off_mm": {"mean": 0.5}})
    return inspection


def _reading(k: int, planned: ScanPlan, scan: np.ndarray, at: np.ndarray, more: complex) -> Reading:
    x, y, z = (float(value) for value in at[k])
    row, point = int(planned.row[scan[k]]), int(planned.point[scan[k]])
    return Reading(row, point, 0.5 * k, (x, y, z), 5e5, complex(1.3, 37.0) + more, 0, (x, y, z))


def behave(inspection: Inspection, **how: object) -> None:
    """Tell the line under test how to behave in this folder."""
    (inspection.folder / "behave.json").write_text(json.dumps(how))
