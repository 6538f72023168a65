"""Depth PNGs and the files beside them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.depth import DepthImage, PinholeCamera
from eddyscan.core.errors import FileError, GeometryError
from eddyscan.formats.depth_images import read_depth_image, read_poses, write_depth_image

CAMERA = PinholeCamera(fx=50, fy=50, cx=7.5, cy=5.5, width=16, height=12, depth_scale_mm=0.1)


def _image(**more):
    depth = 250.0 + np.arange(16 * 12).reshape(12, 16) * 0.1
    depth[2, 3] = np.nan
    return DepthImage(depth, CAMERA, "a.png", **more)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.01, 0.2), st.integers(0, 2**31))
def test_a_written_image_reads_back_within_half_a_count(tmp_path_factory, scale, seed):
    path = tmp_path_factory.mktemp("d") / "v.png"
    depth = np.random.default_rng(seed).uniform(10, 600, (12, 16))
    depth[0, 0] = np.nan
    write_depth_image(DepthImage(depth, CAMERA.model_copy(update={"depth_scale_mm": scale})), path)
    back = read_depth_image(path).depth_mm
    assert np.isnan(back[0, 0])
    assert np.nanmax(np.abs(back - depth)) <= scale / 2 + 1e-9


def test_intensity_and_pose_come_back(tmp_path):
    T = np.eye(4)
    T[:3, 3] = (1.0, 2.0, 3.0)
    grey = np.arange(16 * 12, dtype=np.uint8).reshape(12, 16)
    write_depth_image(_image(T_world_camera=T, intensity=grey), tmp_path / "a.png")
    back = read_depth_image(tmp_path / "a.png", T_world_camera=read_poses(tmp_path)["a.png"])
    assert np.array_equal(back.intensity, grey)
    assert np.array_equal(back.T_world_camera, T)


def test_no_camera_file_says_what_is_needed(tmp_path):
    write_depth_image(_image(), tmp_path / "a.png")
    (tmp_path / "camera.json").unlink()
    with pytest.raises(FileError, match=r'no camera\.json beside .*"depth_scale_mm"'):
        read_depth_image(tmp_path / "a.png")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fx": None}, "fx"),
        ({"fx": -5}, "fx: .*greater than 0"),
        ({"fov": 60}, "fov: Extra inputs"),
    ],
)
def test_a_wrong_camera_file_names_the_field(tmp_path, change, message):
    write_depth_image(_image(), tmp_path / "a.png")
    camera = json.loads((tmp_path / "camera.json").read_text()) | change
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    with pytest.raises(FileError, match="does not describe a camera: " + message):
        read_depth_image(tmp_path / "a.png")


def test_wrong_image_size_names_both_sizes(tmp_path):
    write_depth_image(_image(), tmp_path / "a.png")
    camera = json.loads((tmp_path / "camera.json").read_text()) | {"width": 32}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    with pytest.raises(GeometryError, match=r"a\.png is 16 x 12 px, its camera says 32 x 12"):
        read_depth_image(tmp_path / "a.png")


def test_colour_pictures_truncated_and_empty_files_are_refused(tmp_path):
    import cv2

    write_depth_image(_image(), tmp_path / "a.png")
    good = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(good[:40])
    with pytest.raises(FileError, match="not a readable PNG"):
        read_depth_image(tmp_path / "a.png")
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(FileError, match="empty"):
        read_depth_image(tmp_path / "a.png")
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((12, 16, 3), np.uint8))
    with pytest.raises(FileError, match="uint8 pixels with 3 channel"):
        read_depth_image(tmp_path / "a.png")


def test_depths_beyond_16_bits_are_refused_with_the_limit(tmp_path):
    far = DepthImage(np.full((12, 16), 9000.0), CAMERA, "far")
    with pytest.raises(FileError, match=r"depths up to 9000 mm do not fit 16 bits .*limit 6554 mm"):
        write_depth_image(far, tmp_path / "far.png")


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("not json", FileError, "is not .*4x4"),
        ("[1]", FileError, "not an object"),
        ('{"a.png": [[1,0],[0,1]]}', GeometryError, "a transform is 4x4"),
        ('{"a.png": [[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}', GeometryError, "determinant -1"),
    ],
)
def test_wrong_poses_are_refused(tmp_path, text, error, message):
    (tmp_path / "poses.json").write_text(text)
    with pytest.raises(error, match=message):
        read_poses(tmp_path)
