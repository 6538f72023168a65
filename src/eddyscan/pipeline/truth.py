"""The `truth` part of summary.json: made by the virtual cell, never seen by the steps."""

from __future__ import annotations

from typing import Any

from eddyscan.core.indication import Indication
from eddyscan.inspection import Inspection, read_json
from eddyscan.pipeline.rigs import LazyRig


def truth_of(inspection: Inspection, rig: LazyRig) -> dict[str, Any] | None:
    """Return surface, path and flaw figures against the world, or None on a real rig."""
    world = rig.settings().world
    if world is None:
        return None
    from eddyscan.devices.sim import truth
    from eddyscan.formats.meshes import read_mesh

    figures: dict[str, Any] = {"part": world.part, "seed": world.seed}
    surface = inspection.file("surface", "surface.ply")
    if surface.is_file():
        figures["surface"] = truth.surface_truth(read_mesh(surface), world)
    log = inspection.file("record", "truth.json")
    if log.is_file():
        figures["path"] = truth.path_truth(read_json(log))
    indications = inspection.file("cscan", "indications.json")
    if indications.is_file():
        found = [Indication(**{**entry, "centre_mm": tuple(entry["centre_mm"])}) for entry in read_json(indications)]
        figures["indications"] = truth.indication_truth(found, world)
    return figures
