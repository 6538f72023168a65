"""Named parts are exact: areas, closed solids, closest points."""

import numpy as np
import pytest
import trimesh

from eddyscan.core.errors import InputError
from eddyscan.core.parts import PARTS, named_part

# Areas by quadrature of the exact formulas (mm^2), as published with the planning measurements.
AREAS_MM2 = {"block-c": 22014.63, "dome": 15707.96, "blade": 16463.39, "plate": 20000.0}


@pytest.mark.parametrize("name", AREAS_MM2)
def test_area_is_the_published_one(name: str) -> None:
    assert PARTS[name].top_mesh(1.0).area_mm2 == pytest.approx(AREAS_MM2[name], rel=2e-4)


@pytest.mark.parametrize("name", PARTS)
def test_the_part_frame_rule_holds(name: str) -> None:
    vertices = PARTS[name].top_mesh(2.0).vertices
    np.testing.assert_allclose(vertices.min(axis=0)[:2], 0.0, atol=0.05)
    size = np.ptp(vertices, axis=0)
    assert size[0] >= size[1] - 1e-9
    assert PARTS[name].solid_mesh(4.0).vertices[:, 2].min() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", PARTS)
def test_the_solid_is_closed_and_faces_outwards(name: str) -> None:
    solid = PARTS[name].solid_mesh(3.0)
    mesh = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces())
    assert mesh.is_watertight
    assert mesh.volume > 0


@pytest.mark.parametrize("name", PARTS)
def test_closest_point_of_an_offset_point_is_its_origin(name: str) -> None:
    mesh = PARTS[name].top_mesh(3.0)
    for distance_mm in (-0.4, 0.7, 2.0):
        foot, normal, signed = PARTS[name].closest(mesh.vertices + distance_mm * mesh.normals)
        np.testing.assert_allclose(signed, distance_mm, atol=1e-6)
        if name != "block-d":  # its creases have no single normal
            np.testing.assert_allclose(foot, mesh.vertices, atol=1e-5)
            np.testing.assert_allclose(normal, mesh.normals, atol=1e-4)


def test_block_a_is_the_studys_wave() -> None:
    x = np.linspace(0, 200, 41)
    z = PARTS["block-a"].surface(x, np.zeros_like(x))[:, 2]
    np.testing.assert_allclose(z, 30 + 7.5 * np.sin(2 * np.pi * x / 150), atol=1e-12)


def test_block_d_has_flat_margins() -> None:
    x = np.array([0.0, 10.0, 24.9, 50.0, 175.1, 200.0])
    z = PARTS["block-d"].surface(x, np.zeros_like(x))[:, 2]
    np.testing.assert_allclose(z[[0, 1, 2, 4, 5]], 30.0)
    assert z[3] == pytest.approx(30 + 7.5 * np.sin(np.pi / 2))


def test_an_unknown_part_names_those_there_are() -> None:
    with pytest.raises(InputError, match="known are block-a, block-b"):
        named_part("block-z")
