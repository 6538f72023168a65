"""What the page draws, read from an inspection folder: surface, cloud, plan, readings, C-scan, views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eddyscan.core.errors import FileError, InputError
from eddyscan.core.plan import KINDS
from eddyscan.core.record import ScanRecord
from eddyscan.inspection import Inspection, read_json
from eddyscan.web.packing import packed
from eddyscan.web.placing import COLUMNS, Placing

CLOUD_POINTS = 40_000
VIEW_PX = 320
MAX_VERTICES = 400_000


def surface(inspection: Inspection) -> bytes:
    """Return vertices, normals, faces and uncertainty of 2-surface/surface.ply [mm, part]."""
    from eddyscan.formats.meshes import read_mesh

    mesh = read_mesh(inspection.file("surface", "surface.ply"))
    if len(mesh.vertices) > MAX_VERTICES:
        raise InputError(
            f"the surface has {len(mesh.vertices)} vertices, the page draws {MAX_VERTICES}. "
            "Raise surface.grid_mm in the technique."
        )
    arrays: dict[str, Any] = {
        "vertices": f4(mesh.vertices),
        "normals": f4(mesh.normals),
        "faces": mesh.faces.astype(np.uint32),
    }
    if mesh.uncertainty_mm is not None:
        arrays["uncertainty_mm"] = f4(mesh.uncertainty_mm)
    return packed(arrays, {"views": _view_poses(inspection)})


def cloud(inspection: Inspection) -> bytes:
    """Return at most CLOUD_POINTS points of 2-surface/cloud.ply [mm, part]."""
    from eddyscan.formats.clouds import read_cloud

    points = read_cloud(_there(inspection.file("surface", "cloud.ply"))).points
    step = max(1, -(-len(points) // CLOUD_POINTS))
    return packed({"points": f4(points[::step])}, {"of": len(points), "step": step})


def plan(inspection: Inspection) -> bytes:
    """Return every pose of 3-plan/plan.json [mm, part] and what it leaves out."""
    from eddyscan.formats.plans import read_plan

    planned = read_plan(inspection.file("plan", "plan.json"))
    arrays = {
        "coil": f4(planned.T_part_probe[:, :3, 3]),
        "axis": f4(planned.T_part_probe[:, :3, 2]),
        "spot": f4(planned.surface_mm),
        "kind": planned.kind.astype(np.uint8),
        "row": planned.row.astype(np.int32),
        "point": planned.point.astype(np.int32),
        "tilt_deg": f4(planned.tilt_deg),
        "lift_off_mm": f4(planned.lift_off_mm),
        "time_s": f4(planned.time_s),
    }
    uncovered = [vars(spot) for spot in planned.coverage.uncovered]
    limit = inspection.technique().analysis.lift_off_max_mm
    facts = {"kinds": list(KINDS), "uncovered": uncovered, "notes": list(planned.notes), "lift_off_limit_mm": limit}
    return packed(arrays, facts)


def record(inspection: Inspection) -> bytes:
    """Return every reading so far as a table with the columns of the live wire."""
    readings = read_readings(inspection)
    table = np.full((len(readings), len(COLUMNS)), np.nan)
    if len(readings):
        placing = Placing(inspection.folder)
        table = placing.table(readings)
    return packed({"rows": table}, {"columns": list(COLUMNS), "events": readings.meta.get("events", [])[-50:]})


def cscan(inspection: Inspection) -> bytes:
    """Return the C-scan's channels per vertex and the analysed values per reading."""
    from eddyscan.formats.record_ply import read_cscan_ply

    mapped = read_cscan_ply(_there(inspection.file("cscan", "cscan.ply")))
    arrays: dict[str, Any] = {f"channel {name}": f4(values) for name, values in mapped.channels.items()}
    arrays["covered"] = mapped.covered.astype(np.uint8)
    with np.load(_there(inspection.file("cscan", "readings.npz"))) as kept:
        residual = kept["residual_ohm"]
        arrays["lift_off_mm"] = f4(kept["lift_off_mm"])
    arrays["residual_re_ohm"], arrays["residual_im_ohm"] = f4(residual.real), f4(residual.imag)
    return packed(arrays, {})


def view(inspection: Inspection, name: Any) -> bytes:
    """Return one view as a small picture of depths [mm], or as thinned points for a cloud."""
    from eddyscan.core.depth import DepthImage
    from eddyscan.formats.views import read_views

    files = {path.name: path for path in inspection.view_files()}
    if name not in files:
        raise FileError(f"there is no view {str(name)[:80]!r} in {inspection.step_folder('views')}.")
    seen = read_views([files[name]])[0]
    if isinstance(seen, DepthImage):
        step = max(1, -(-seen.camera.width // VIEW_PX))
        return packed({"depth_mm": f4(seen.depth_mm[::step, ::step])}, {"name": name, "kind": "depth"})
    step = max(1, -(-len(seen.points) // CLOUD_POINTS))
    facts = {"name": name, "kind": "cloud", "of": len(seen.points), "dropped": seen.dropped}
    return packed({"points": f4(seen.points[::step])}, facts)


def read_readings(inspection: Inspection) -> ScanRecord:
    """Read the record as far as it has come."""
    from eddyscan.formats.records import read_record

    return read_record(_there(inspection.file("record", "record.sqlite")))


def f4(values: Any) -> NDArray[np.float32]:
    """Return values as float32."""
    return np.asarray(values, dtype=np.float32)


def _there(path: Path) -> Path:
    if not path.is_file():
        raise FileError(f"{path.parent.name}/{path.name} is not there yet. Run the step that makes it.")
    return path


def _view_poses(inspection: Inspection) -> list[dict[str, Any]]:
    path = inspection.file("surface", "registration.json")
    return list(read_json(path).get("views", [])) if path.is_file() else []


SCENES = {"surface": surface, "cloud": cloud, "plan": plan, "record": record, "cscan": cscan}
