"""Bring all views into one table frame, or say by name which could not be brought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eddyscan.core.depth import DepthImage
from eddyscan.core.frames import Array, apply, transform
from eddyscan.core.progress import Progress, silent
from eddyscan.core.registration import Registration
from eddyscan.surface.height_map import height_map
from eddyscan.surface.pose_search import PairSearch
from eddyscan.surface.refine import JointResult, joint_refinement, pair_quality
from eddyscan.surface.table import find_table, level_table, table_in
from eddyscan.surface.view import View
from eddyscan.surface.view_graph import ViewGraph, connect


@dataclass(frozen=True)
class Registered:
    """All views in one table frame.

    Attributes
    ----------
    views : posed views in the order given; None where a view was rejected
    registrations : one per view, T_world_view
    warnings : tuple of str
    joint : normal system of the registration over the used views; None when poses were given
    reference : index, among the used views, of the one that carries the frame
    """

    views: tuple[View | None, ...]
    registrations: tuple[Registration, ...]
    warnings: tuple[str, ...]
    joint: JointResult | None = None
    reference: int = 0


def register(images: Sequence[DepthImage], views: Sequence[View], *, progress: Progress = silent) -> Registered:
    """Find every view's pose: given ones are kept, others searched and refined together.

    Parameters
    ----------
    images : as given, for their poses
    views : the same, prepared; their poses are not used
    """
    given = [image.T_world_camera is not None for image in images]
    if all(given):
        return _given(images, views)
    views = [replace(v, T_world_camera=find_table(v.surfels, v.name).T_table_camera) for v in views]
    if len(views) == 1:
        only = Registration(views[0].name, views[0].T_world_camera, 0.0, 1.0, True, ("single view",))
        return Registered(tuple(views), (only,), ("a single view: nothing checks its registration or its shape",))
    progress("finding where the cameras stood", 0, 1)
    search = PairSearch([height_map(v.surfels, v.T_world_camera) for v in views])
    graph = connect(search, [v.name for v in views])
    progress("finding where the cameras stood", 1, 1)
    kept = [k for k, T in enumerate(graph.poses) if T is not None]
    start = [np.asarray(graph.poses[k]) @ views[k].T_world_camera for k in kept]
    progress("registering all views together", 0, 1)
    joint = joint_refinement([views[k].surfels for k in kept], start, reference=kept.index(graph.reference))
    progress("registering all views together", 1, 1)
    level = level_table(
        [replace(views[k], T_world_camera=T) for k, T in zip(kept, joint.poses, strict=True)], joint.centre
    )
    poses = tuple(level @ T for T in joint.poses)
    joint = replace(joint, poses=poses, centre=apply(level, joint.centre[None])[0])
    return _searched(views, graph, joint, kept)


def _searched(views: Sequence[View], graph: ViewGraph, joint: JointResult, kept: list[int]) -> Registered:
    reasons = dict(graph.rejected)
    posed: list[View | None] = []
    registrations = []
    for k, view in enumerate(views):
        if k not in kept:
            posed.append(None)
            registrations.append(Registration(view.name, view.T_world_camera, np.inf, 0.0, False, (reasons[k],)))
            continue
        at = kept.index(k)
        posed.append(replace(view, T_world_camera=joint.poses[at]))
        registrations.append(_quality(view.name, joint.poses[at], joint, at))
    warnings = tuple(f"{views[k].name} left out: {why}" for k, why in graph.rejected)
    return Registered(tuple(posed), tuple(registrations), warnings, joint, kept.index(graph.reference))


def _quality(name: str, pose: Array, joint: JointResult, at: int, source: str = "registered") -> Registration:
    rmse = np.concatenate([joint.pair_rmse_mm[at], joint.pair_rmse_mm[:, at]])
    known = rmse[np.isfinite(rmse)]
    value = float(np.sqrt(np.mean(known**2))) if known.size else float("inf")
    return Registration(name, pose, value, float(joint.pair_share[at].max()), True, (), source)


def _given(images: Sequence[DepthImage], views: Sequence[View]) -> Registered:
    """Keep given poses; only the table under the part is found, from all views together."""
    given = [np.asarray(image.T_world_camera) for image in images]
    centre = np.mean([T[:3, 3] for T in given], axis=0)
    points = np.concatenate(
        [apply(T, v.surfels.points[v.surfels.valid].astype(np.float64)) for T, v in zip(given, views, strict=True)]
    )
    table = table_in(points - centre, "the views together")
    T_table_world = table.T_table_camera @ transform(None, -centre)
    poses = [T_table_world @ T for T in given]
    check = pair_quality([v.surfels for v in views], poses)
    posed = tuple(replace(v, T_world_camera=T) for v, T in zip(views, poses, strict=True))
    qualities = tuple(_quality(v.name, T, check, k, "given") for k, (v, T) in enumerate(zip(views, poses, strict=True)))
    return Registered(posed, qualities, ())
