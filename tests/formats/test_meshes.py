"""Mesh files keep what was written and refuse what cannot be a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.formats.meshes import read_mesh, write_mesh


@settings(max_examples=20, deadline=None)
@given(arrays(np.float64, (5, 3), elements=st.floats(-1e4, 1e4)), arrays(np.float64, 5, elements=st.floats(0, 1)))
def test_a_written_mesh_reads_back_as_it_was(tmp_path_factory, vertices, uncertainty):
    path = tmp_path_factory.mktemp("mesh") / "a.ply"
    mesh = SurfaceMesh.from_triangles(vertices, np.array([[0, 1, 2], [2, 3, 4]]), uncertainty)
    write_mesh(mesh, path)
    back = read_mesh(path)
    assert np.array_equal(back.vertices, vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert back.uncertainty_mm == pytest.approx(uncertainty, abs=1e-7)


def test_normals_survive_and_are_unit(tmp_path):
    mesh = named_part("dome").top_mesh(5.0)
    write_mesh(mesh, tmp_path / "dome.ply")
    back = read_mesh(tmp_path / "dome.ply")
    assert back.normals == pytest.approx(mesh.normals, abs=1e-6)
    assert back.uncertainty_mm is None


@pytest.mark.parametrize("suffix", [".stl", ".obj"])
def test_other_formats_come_in_with_merged_vertices(tmp_path, suffix):
    import trimesh

    plate = named_part("plate").top_mesh(20.0)
    trimesh.Trimesh(plate.vertices, plate.faces, process=False).export(tmp_path / f"plate{suffix}")
    back = read_mesh(tmp_path / f"plate{suffix}")
    assert len(back.vertices) == len(plate.vertices)
    assert back.area_mm2 == pytest.approx(plate.area_mm2, rel=1e-5)


def test_ascii_ply_with_polygons_and_extra_properties(tmp_path):
    (tmp_path / "q.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "property uchar red\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n4 0 1 2 3\n"
    )
    mesh = read_mesh(tmp_path / "q.ply")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.area_mm2 == pytest.approx(1.0)


def _plate(tmp_path: Path) -> Path:
    path = tmp_path / "plate.ply"
    write_mesh(named_part("plate").top_mesh(10.0), path)
    return path


@pytest.mark.parametrize("share", [0.999, 0.5, 0.1])
def test_a_truncated_ply_is_refused_and_says_how_much_is_missing(tmp_path, share):
    path = _plate(tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(FileError, match=r"truncated: its \d+ (vertex|face) entries need \d+ bytes, \d+ are there"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", b"", r"empty \(0 bytes\)"),
        ("a.ply", b"solid thing", "not a PLY file"),
        ("a.txt", b"1 2 3", "no mesh file; readable are .ply"),
        ("a.stl", b"not an stl at all", "no triangles"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty banana x\nend_header\n1\n", "unknown type"),
    ],
)
def test_unusable_files_are_named_with_the_way_out(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_mesh(tmp_path / name)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileError, match=r"no-such.ply does not exist"):
        read_mesh(tmp_path / "no-such.ply")


def test_a_cloud_is_not_a_mesh(tmp_path):
    from eddyscan.core.cloud import PointCloud
    from eddyscan.formats.clouds import write_cloud

    write_cloud(PointCloud(np.eye(3)), tmp_path / "c.ply")
    with pytest.raises(FileError, match="3 points but no faces: it is a point cloud"):
        read_mesh(tmp_path / "c.ply")


def test_faces_that_name_missing_vertices_and_nan_vertices_are_refused(tmp_path):
    from eddyscan.formats.ply import write_ply

    square = {"x": np.array([0.0, 1, 1]), "y": np.array([0.0, 0, 1]), "z": np.zeros(3)}
    write_ply(tmp_path / "f.ply", square, np.array([[0, 1, 7]]))
    with pytest.raises(GeometryError, match="names vertex 7, the file has 3"):
        read_mesh(tmp_path / "f.ply")
    write_ply(tmp_path / "n.ply", square | {"z": np.array([0, np.nan, 0])}, np.array([[0, 1, 2]]))
    with pytest.raises(GeometryError, match="1 of 3 mesh vertices are NaN"):
        read_mesh(tmp_path / "n.ply")


def test_writing_under_another_suffix_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"written as \.ply"):
        write_mesh(named_part("plate").top_mesh(20.0), tmp_path / "a.obj")
