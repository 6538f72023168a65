"""The `truth` part of summary.json: made by the virtual cell, never seen by the steps."""

from __future__ import annotations

from typing import Any

from eddyscan.core.indication import Indication
from eddyscan.inspection import Inspection, read_json, write_json
from eddyscan.pipeline.rigs import LazyRig

TRUTH_LOG = "truth.json"


def truth_of(inspection: Inspection, rig: LazyRig) -> dict[str, Any] | None:
    """Return surface, path and flaw figures against the world, or None on a real rig."""
    world = rig.settings().world
    if world is None:
        return None
    from eddyscan.devices.sim import truth
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.formats.records import read_record

    figures: dict[str, Any] = {"part": world.part, "seed": world.seed}
    surface = inspection.file("surface", "surface.ply")
    mesh = read_mesh(surface) if surface.is_file() else None
    if mesh is not None:
        figures["surface"] = truth.surface_truth(mesh, world)
    log_file, record_file = inspection.file("record", TRUTH_LOG), inspection.file("record", "record.sqlite")
    if not (log_file.is_file() and record_file.is_file()):
        return figures
    log, record = read_json(log_file), read_record(record_file)
    figures["path"] = truth.path_truth(log, record, lift_off_mm=inspection.technique().scan.lift_off_mm)
    indications = inspection.file("cscan", "indications.json")
    if indications.is_file():
        found = [Indication(**{**entry, "centre_mm": tuple(entry["centre_mm"])}) for entry in read_json(indications)]
        figures["indications"] = truth.indication_truth(found, world, mesh=mesh, log=log, record=record)
    return figures


def keep_truth_log(inspection: Inspection, log: dict[str, Any]) -> None:
    """Write what the world knows of each reading beside the record; a resumed scan adds to it."""
    path = inspection.file("record", TRUTH_LOG)
    earlier = read_json(path) if path.is_file() else {}
    columns = {key for key, value in log.items() if isinstance(value, list) and not key.startswith("T_")}
    write_json(path, log | {key: [*earlier.get(key, []), *log[key]] for key in columns})
