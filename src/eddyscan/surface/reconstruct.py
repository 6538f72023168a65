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
from eddyscan.surface.crop import cropped
from eddyscan.surface.fusion import cells_inside, collect_cells, fuse, is_height_field
from eddyscan.surface.height_field import rough_height
from eddyscan.surface.part_frame import PartFrame, locate_part
from eddyscan.surface.prepare import prepare
from eddyscan.surface.register import Registered, register
from eddyscan.surface.sharpen import FAR_LOOK, Look, Sharpened, is_loose, sharpen
from eddyscan.surface.study import reconstruct_as_study
from eddyscan.surface.view import View
from eddyscan.surface.virtual_camera import as_depth_image
from eddyscan.surface.weak import refuse_slides, weak_directions

CLOUD_LIMIT = 200_000
ROUGH_CELL_MM = 2.0
BORDER_SHARE = 0.85


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
    _refuse_mixed(views)
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
    part = locate_part(used)
    used, part, information = _sharpened(used, part, registered)
    weak = weak_directions(information, registered, part)
    progress("finding the part", 1, 1)
    surface = fuse(used, part, settings, progress=progress)
    warnings = (*registered.warnings, *refuse_slides(weak), *part.warnings, *surface.warnings)
    mesh = surface.mesh if settings.crop is None else cropped(surface.mesh, settings.crop)
    cloud = _merged_cloud(used, part)
    return Reconstruction(mesh, _in_part_frame(registered, used, part, weak), cloud, warnings, surface.method)


def _refuse_mixed(views: Sequence[DepthImage | PointCloud]) -> None:
    """Refuse views of which only some have a pose, and the same picture given twice."""
    posed = [isinstance(v, DepthImage) and v.T_world_camera is not None for v in views]
    if any(posed) and not all(posed):
        bare = ", ".join(v.name for v, p in zip(views, posed, strict=True) if not p)
        raise RegistrationError(
            f"{sum(posed)} of {len(views)} views carry a pose, {bare} carry none: poses of two worlds cannot be mixed. "
            "Give every view its pose, or none."
        )
    values = [v.depth_mm if isinstance(v, DepthImage) else v.points for v in views]
    for k, value in enumerate(values):
        for m in range(k):
            if value.shape == values[m].shape and np.array_equal(value, values[m], equal_nan=True):
                raise RegistrationError(
                    f"{views[m].name} and {views[k].name} are the same picture, number by number: it says nothing "
                    "new about the part. Leave one out."
                )


def _sharpened(
    views: list[View], part: PartFrame, registered: Registered
) -> tuple[list[View], PartFrame, Array | None]:
    """Correct poses and outline by the part's border, when its top is a height field that has one."""
    joint = registered.joint
    information = None if joint is None else joint.information
    if not is_height_field(views, part):
        return views, part, information
    if is_loose(information, registered.reference):
        views = list(_border_pass(views, part, registered, (FAR_LOOK,)).views)
        part = locate_part(views)
    result = _border_pass(views, part, registered, None)
    warnings = tuple(dict.fromkeys((*part.warnings, *result.part.warnings)))
    if result.border_share < BORDER_SHARE:
        warnings += (
            f"only {100 * result.border_share:.0f} % of the part's outline show a clear edge in any view (need "
            f"{100 * BORDER_SHARE:.0f} %): the part runs out of the pictures or its rim is hidden, and the outline is "
            "a guess there. Take views that show the whole part.",
        )
    return list(result.views), replace(result.part, warnings=warnings), result.information


def _border_pass(
    views: list[View], part: PartFrame, registered: Registered, looks: tuple[Look, ...] | None
) -> Sharpened:
    cells = collect_cells(views, part, cell_mm=ROUGH_CELL_MM)
    top = rough_height(cells, cells_inside(cells, part), margin_mm=18.0)
    joint = registered.joint
    return sharpen(
        views,
        part,
        lambda xy: top.at(xy[:, 0], xy[:, 1]),
        information=None if joint is None else joint.information,
        centre=np.zeros(3) if joint is None else joint.centre,
        reference=registered.reference,
        looks=looks,
    )


def _in_part_frame(
    registered: Registered, used: list[View], part: PartFrame, weak: dict[str, tuple[str, ...]]
) -> tuple[Registration, ...]:
    posed = iter(used)
    return tuple(
        replace(
            r,
            T_target_source=part.T_part_world @ next(posed).T_world_camera,
            weak_directions=r.weak_directions + weak.get(r.view, ()),
        )
        if r.converged
        else r
        for r in registered.registrations
    )


def _merged_cloud(views: Sequence[View], part: PartFrame) -> PointCloud:
    points = np.concatenate([v.points_in(part.T_part_world, *part.box(3.0))[0] for v in views])
    step = max(1, int(np.ceil(len(points) / CLOUD_LIMIT)))
    thinned: Array = points[::step]
    return PointCloud(np.ascontiguousarray(thinned), "part", name="merged")
