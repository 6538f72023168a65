"""Point cloud files of every kind that a depth camera or a scanner writes."""

from __future__ import annotations

import numpy as np
import pytest

from eddyscan.core.cloud import PointCloud
from eddyscan.core.errors import FileError
from eddyscan.formats.clouds import read_cloud, write_cloud

POINTS = np.random.default_rng(7).uniform(-300, 300, (500, 3))


@pytest.mark.parametrize(("suffix", "tolerance"), [(".ply", 0.0), (".xyz", 1e-5), (".e57", 1e-3)])
def test_a_written_cloud_reads_back(tmp_path, suffix, tolerance):
    path = tmp_path / f"c{suffix}"
    write_cloud(PointCloud(POINTS), path)
    back = read_cloud(path)
    assert np.abs(back.points - POINTS).max() <= tolerance
    assert back.name == path.name
    assert back.dropped == 0


def _pcd(tmp_path, data, kind):
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\n"
        f"WIDTH {len(POINTS)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(POINTS)}\nDATA {kind}\n"
    )
    path = tmp_path / "c.pcd"
    path.write_bytes(head.encode() + data)
    return path


def _binary_pcd():
    table = np.zeros(len(POINTS), dtype=[("xyz", "<f4", (3,)), ("rgb", "<u4")])
    table["xyz"] = POINTS
    return table.tobytes()


def test_pcd_in_text_and_binary(tmp_path):
    text = "\n".join(f"{x} {y} {z} 0" for x, y, z in POINTS).encode()
    assert read_cloud(_pcd(tmp_path, text, "ascii")).points == pytest.approx(POINTS)
    assert read_cloud(_pcd(tmp_path, _binary_pcd(), "binary")).points == pytest.approx(POINTS, abs=1e-4)


def test_a_pcd_written_by_open3d_is_read(tmp_path):
    from eddyscan.surface.open3d_adapter import cloud, open3d

    open3d().io.write_point_cloud(str(tmp_path / "o.pcd"), cloud(POINTS))
    assert read_cloud(tmp_path / "o.pcd").points == pytest.approx(POINTS, abs=1e-3)


def test_nan_points_are_left_out_and_counted(tmp_path):
    from eddyscan.formats.ply import write_ply

    dirty = POINTS.copy()
    dirty[3, 1], dirty[8, 2] = np.nan, np.inf
    write_ply(tmp_path / "n.ply", {name: dirty[:, k] for k, name in enumerate("xyz")})
    back = read_cloud(tmp_path / "n.ply")
    assert (len(back), back.dropped) == (len(POINTS) - 2, 2)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.xyz", b"", r"empty \(0 bytes\)"),
        ("a.xyz", b"1 2\n3 4\n", "fewer than 3 numbers"),
        ("a.xyz", b"x y z\n1 2 3\n", "not a table of x y z numbers"),
        ("a.pcd", b"VERSION 0.7\n", "not a PCD file with x, y, z"),
        ("a.e57", b"this is no E57 file at all" * 10, "cannot be read as E57"),
        ("a.csv", b"1,2,3", "no point cloud file; readable are .ply"),
        ("a.xyz", b"nan nan nan\n", "1 points, none of them finite"),
    ],
)
def test_unusable_files_are_named_with_the_way_out(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_cloud(tmp_path / name)


def test_truncated_pcd_says_what_is_missing(tmp_path):
    with pytest.raises(FileError, match="truncated: 500 points need 8000 bytes, 4000 are there"):
        read_cloud(_pcd(tmp_path, _binary_pcd()[:4000], "binary"))


def test_compressed_pcd_says_how_to_save_it(tmp_path):
    with pytest.raises(FileError, match="Save it uncompressed"):
        read_cloud(_pcd(tmp_path, b"xxxx", "binary_compressed"))
