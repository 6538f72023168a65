"""Where the part lies on the stage: found once for a record, kept beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.frames import Array, checked_transform
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import ScanPlan
from eddyscan.core.progress import Progress
from eddyscan.inspection import Inspection, read_json, write_json

if TYPE_CHECKING:
    from eddyscan.core.technique import Technique
    from eddyscan.devices.rig import Rig

FILE = "alignment.json"
TOUCHED = "alignment.json"  # in the inspection folder itself: what the operator jogged to


@dataclass(frozen=True)
class Placing:
    """The part on the stage.

    Attributes
    ----------
    T_stage_part : (4, 4)
    scale : float
        True size over the camera's; 1 when only the corner is known.
    details : dict
        What alignment.json holds: how, uncertainties, air reading, fitted coil.
    """

    T_stage_part: Array
    scale: float
    details: dict[str, Any]

    def mesh(self, mesh: SurfaceMesh) -> SurfaceMesh:
        """Return the mesh in its true size."""
        return replace(mesh, vertices=mesh.vertices * self.scale)

    def plan(self, plan: ScanPlan) -> ScanPlan:
        """Return the plan in the part's true size."""
        T = plan.T_part_probe.copy()
        T[:, :3, 3] *= self.scale
        return replace(plan, surface_mm=plan.surface_mm * self.scale, s_mm=plan.s_mm * self.scale, T_part_probe=T)


def kept_placing(inspection: Inspection) -> Placing | None:
    """Return the placing an earlier start of this scan found, or None."""
    path = inspection.file("record", FILE)
    if not path.is_file():
        return None
    details = read_json(path)
    return Placing(checked_transform(details["T_stage_part"], str(path)), float(details.get("scale", 1.0)), details)


def operators_placing(inspection: Inspection, rig: Rig, mesh: SurfaceMesh) -> Placing:
    """Return the placing as `eddyscan jog`, rig.toml or the virtual operator gives it; nothing moves."""
    touched = inspection.folder / TOUCHED
    if touched.is_file():
        details = read_json(touched)
        return Placing(checked_transform(details["T_stage_part"], str(touched)), 1.0, details)
    T_stage_part, how = rig.alignment(mesh)
    return Placing(T_stage_part, 1.0, {"T_stage_part": np.asarray(T_stage_part).tolist(), "how": how})


def measured_placing(
    inspection: Inspection, rig: Rig, mesh: SurfaceMesh, technique: Technique, progress: Progress
) -> Placing:
    """Find the part with the coil when the technique says so, read the coil in air, and keep the result."""
    from eddyscan.scanning.field_alignment import align
    from eddyscan.scanning.field_motion import FieldProbe

    corner = operators_placing(inspection, rig, mesh)
    if technique.scan.alignment == "field":
        found = align(
            mesh,
            technique,
            stage=rig.stage,
            instrument=rig.instrument,
            clock=rig.clock,
            T_stage_part=corner.T_stage_part,
            progress=progress,
        )
        details = found.as_dict() | {"how": f"by the coil's field, from {corner.details['how']}"}
        placing = Placing(found.T_stage_part, found.scale, details)
    else:
        air = _air_reading(FieldProbe(rig.stage, rig.instrument, rig.clock, technique), technique)
        placing = replace(corner, details=corner.details | {"air": [air.real, air.imag]})
    write_json(inspection.file("record", FILE), placing.details)
    return placing


def _air_reading(probe: Any, technique: Technique) -> complex:
    from eddyscan.scanning.field_alignment import read_air

    if not probe.stage.is_homed():
        probe.stage.home()
    probe.instrument.configure(technique.drive)
    return complex(read_air(probe))
