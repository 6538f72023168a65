"""Views in, surface out: the order of the steps and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage
from eddyscan.core.errors import RegistrationError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress, silent
from eddyscan.core.registration import Registration
from eddyscan.core.technique import Surface
from eddyscan.surface.fusion import cells_inside, collect_cells, fuse, is_height_field
from eddyscan.surface.height_field import rough_height
from eddyscan.surface.part_frame import PartFrame, locate_part
from eddyscan.surface.prepare import prepare
from eddyscan.surface.register import Registered, register
from eddyscan.surface.sharpen import sharpen
from eddyscan.surface.study import reconstruct_as_study
from eddyscan.surface.view import View
from eddyscan.surface.virtual_camera import as_depth_image

CLOUD_LIMIT = 200_000
ROUGH_CELL_MM = 2.0


@dataclass(frozen=True)
class Reconstruction:
    """The surface and how it came about.

    Attributes
    ----------
    mesh : SurfaceMesh in the part frame, standard uncertainty per vertex
    registrations : one per view, in the order given; T_target_source = T_part_view
    cloud : merged PointCloud in the part frame, thinned to at most 200 000 points
    warnings : what a reader must know
    method : "height field", "free form" or "study"
    """

    mesh: SurfaceMesh
    registrations: tuple[Registration, ...]
    cloud: PointCloud
    warnings: tuple[str, ...]
    method: str


def reconstruct(
    views: Sequence[DepthImage | PointCloud],
    settings: Surface,
    *,
    single_view: bool = False,
    progress: Progress = silent,
) -> Reconstruction:
    """Turn camera views of one part on a table into its surface.

    Parameters
    ----------
    views : depth images or point clouds, in any order, no poses needed
        Views that carry `T_world_camera` are taken to stand there.
    settings : technique.Surface
    single_view : bool
        Allow one view alone: what it did not see stays unknown.

    Raises
    ------
    RegistrationError
        Fewer than two views, no table, nothing on it, views of different scenes.
    GeometryError
        Views that hold nothing usable.
    """
    if len(views) < 2 and not single_view:
        raise RegistrationError(
            f"{len(views)} view given, at least 2 are needed to see all sides and to check one against the other. "
            "Take more views, or allow a single one (--single-view)."
        )
    images = [v if isinstance(v, DepthImage) else as_depth_image(v) for v in views]
    if settings.method == "study":
        return reconstruct_as_study(images, settings, progress)
    prepared = []
    for k, image in enumerate(images):
        progress("cleaning views", k, len(images))
        prepared.append(prepare(image, settings))
    progress("cleaning views", len(images), len(images))
    registered = register(images, prepared, progress=progress)
    used = [v for v in registered.views if v is not None]
    progress("finding the part", 0, 1)
    part = locate_part(used, settings.crop)
    used, part = _sharpened(used, part, registered)
    progress("finding the part", 1, 1)
    surface = fuse(used, part, settings, progress=progress)
    warnings = (*registered.warnings, *part.warnings, *surface.warnings)
    cloud = _merged_cloud(used, part)
    return Reconstruction(surface.mesh, _in_part_frame(registered, used, part), cloud, warnings, surface.method)


def _sharpened(views: list[View], part: PartFrame, registered: Registered) -> tuple[list[View], PartFrame]:
    """Correct poses and outline by the part's border, when its top is a height field that has one."""
    if not is_height_field(views, part):
        return views, part
    cells = collect_cells(views, part, cell_mm=ROUGH_CELL_MM)
    top = rough_height(cells, cells_inside(cells, part), margin_mm=6.0)
    joint = registered.joint
    result = sharpen(
        views,
        part,
        lambda xy: top.at(xy[:, 0], xy[:, 1]),
        information=None if joint is None else joint.information,
        centre=np.zeros(3) if joint is None else joint.centre,
        reference=registered.reference,
    )
    return list(result.views), replace(
        result.part, warnings=tuple(dict.fromkeys((*part.warnings, *result.part.warnings)))
    )


def _in_part_frame(registered: Registered, used: list[View], part: PartFrame) -> tuple[Registration, ...]:
    posed = iter(used)
    return tuple(
        replace(r, T_target_source=part.T_part_world @ next(posed).T_world_camera) if r.converged else r
        for r in registered.registrations
    )


def _merged_cloud(views: Sequence[View], part: PartFrame) -> PointCloud:
    points = np.concatenate([v.points_in(part.T_part_world, *part.box(3.0))[0] for v in views])
    step = max(1, int(np.ceil(len(points) / CLOUD_LIMIT)))
    thinned: Array = points[::step]
    return PointCloud(np.ascontiguousarray(thinned), "part", name="merged")
