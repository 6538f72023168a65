"""Jogging to the part: the touched points become the placing that the next scan starts from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.errors import InputError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.inspection import Inspection, write_json
from eddyscan.pipeline.alignment import TOUCHED
from eddyscan.pipeline.rigs import LazyRig

if TYPE_CHECKING:
    from eddyscan.scanning.jog import JogSession


@contextmanager
def jog_session(folder: Path, *, rig_file: Path | None = None, arm: bool = False) -> Iterator[JogSession]:
    """Yield a session at the rig's stage; the stage is stopped and closed at the end."""
    from eddyscan.scanning.jog import JogSession

    inspection = Inspection.open(folder)
    with inspection.locked(), ExitStack() as stack:
        rig = LazyRig(inspection, rig_file, arm, stack).open()
        try:
            yield JogSession(rig.stage)
        finally:
            rig.stage.stop()


def keep_touched(folder: Path, touched_mm: Sequence[Array], part_mm: Sequence[Sequence[float]]) -> dict[str, Any]:
    """Solve and keep the placing from touched points.

    Parameters
    ----------
    touched_mm : one (the corner) or three and more (3,) axis readings [mm, stage]
    part_mm : the same points on the part [mm, part]; empty for one touched corner:
        the surface's corner at the smallest x and y

    Raises
    ------
    InputError
        When the numbers of points do not match.
    GeometryError
        When three points lie on a line or do not fit the part.
    """
    from eddyscan.formats.meshes import read_mesh
    from eddyscan.scanning.alignment import align_from_corner, align_from_points

    inspection = Inspection.open(folder)
    if len(touched_mm) == 1:
        mesh = read_mesh(inspection.file("surface", "surface.ply"))
        corner = np.asarray(part_mm[0], dtype=float) if part_mm else origin_corner(mesh)
        found = align_from_corner(touched_mm[0], corner)
    elif len(touched_mm) == len(part_mm):
        found = align_from_points(np.array(touched_mm), np.asarray(part_mm, dtype=float))
    else:
        raise InputError(
            f"{len(touched_mm)} points were touched and {len(part_mm)} named with --point; take one corner, or as "
            "many as are named (three or more)."
        )
    note = found.note() | {"how": f"jogged: {found.method}"}
    write_json(inspection.folder / TOUCHED, note)
    inspection.log("aligned", **{key: value for key, value in note.items() if key != "T_stage_part"})
    return note


def origin_corner(mesh: SurfaceMesh) -> Array:
    """Return the surface's vertex nearest to the smallest x and y (3,) [mm, part]."""
    low = mesh.vertices[:, :2].min(axis=0)
    nearest = int(np.hypot(*(mesh.vertices[:, :2] - low).T).argmin())
    return np.asarray(mesh.vertices[nearest])
