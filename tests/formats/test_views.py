"""Views of any kind, in the order given, with the poses that lie beside them."""

from __future__ import annotations

import numpy as np
import pytest

from eddyscan.core.cloud import PointCloud
from eddyscan.core.depth import DepthImage, PinholeCamera
from eddyscan.core.errors import FileError
from eddyscan.formats.clouds import write_cloud
from eddyscan.formats.depth_images import write_depth_image
from eddyscan.formats.views import read_views

CAMERA = PinholeCamera(fx=50, fy=50, cx=7.5, cy=5.5, width=16, height=12, depth_scale_mm=0.1)


def _write(folder, name, pose=None):
    write_depth_image(DepthImage(np.full((12, 16), 300.0), CAMERA, name, pose), folder / name)
    return folder / name


def test_mixed_views_keep_their_order(tmp_path):
    write_cloud(PointCloud(np.ones((5, 3))), tmp_path / "c.ply")
    views = read_views([tmp_path / "c.ply", _write(tmp_path, "b.png"), _write(tmp_path, "a.png")])
    assert [v.name for v in views] == ["c.ply", "b.png", "a.png"]
    assert isinstance(views[0], PointCloud)


def test_poses_beside_the_views_are_taken(tmp_path):
    T = np.eye(4)
    T[2, 3] = 99.0
    views = read_views([_write(tmp_path, "a.png", T), _write(tmp_path, "b.png", np.eye(4))])
    assert np.array_equal(views[0].T_world_camera, T)


def test_poses_for_some_views_only_are_refused_by_name(tmp_path):
    paths = [_write(tmp_path, "a.png", np.eye(4)), _write(tmp_path, "b.png")]
    with pytest.raises(FileError, match=r"names 1 of 2 views; b\.png have no pose"):
        read_views(paths)


def test_the_same_file_twice_is_refused(tmp_path):
    path = _write(tmp_path, "a.png")
    with pytest.raises(FileError, match="given twice"):
        read_views([path, path])


def test_unknown_kinds_and_missing_files_are_named(tmp_path):
    (tmp_path / "a.tif").write_bytes(b"x")
    with pytest.raises(FileError, match=r"unknown kind \.tif"):
        read_views([tmp_path / "a.tif"])
    with pytest.raises(FileError, match=r"b\.png does not exist"):
        read_views([tmp_path / "b.png"])
