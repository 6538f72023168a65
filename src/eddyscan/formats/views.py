"""Views from files: depth PNG + `camera.json`, clouds, and poses that lie beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage
from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.formats.clouds import READABLE as CLOUDS
from eddyscan.formats.clouds import read_cloud
from eddyscan.formats.depth_images import read_depth_image, read_poses


def read_views(paths: Sequence[Path | str]) -> list[DepthImage | PointCloud]:
    """Read views in the order given.

    Parameters
    ----------
    paths : depth .png (with `camera.json` beside it) or .ply, .pcd, .xyz, .e57
        When a `poses.json` beside them names a depth image, that pose [mm] is taken as given.

    Raises
    ------
    FileError
        A file is missing, empty, truncated, of another kind or given twice; `poses.json` names only some of the views.
    """
    files = [Path(p) for p in paths]
    _refuse_repeats(files)
    poses: dict[Path, dict[str, Array]] = {}
    views: list[DepthImage | PointCloud] = []
    for path in files:
        if path.parent not in poses:
            poses[path.parent] = read_poses(path.parent)
        views.append(_read(path, poses[path.parent].get(path.name)))
    known = [p.name in poses[p.parent] for p in files]
    if any(known) and not all(known):
        missing = [p.name for p, k in zip(files, known, strict=True) if not k]
        raise FileError(
            f"poses.json names {sum(known)} of {len(files)} views; {', '.join(missing)} have no pose. "
            "Add them, or remove poses.json to register all views."
        )
    return views


def _refuse_repeats(files: Sequence[Path]) -> None:
    seen: set[Path] = set()
    for path in files:
        if path.resolve() in seen:
            raise FileError(f"{path} is given twice; every view must be a view of its own.")
        seen.add(path.resolve())


def _read(path: Path, pose: Array | None) -> DepthImage | PointCloud:
    kind = path.suffix.lower()
    if kind == ".png":
        return read_depth_image(path, T_world_camera=pose)
    if kind in CLOUDS:
        cloud = read_cloud(path)
        return cloud
    raise FileError(f"{path} is of an unknown kind {kind or '(no suffix)'}; views are .png, {', '.join(CLOUDS)}.")
