"""Meshes nobody wants: refused with the reason and the way out, or repaired by name."""

import re

import numpy as np
import pytest

from eddyscan.core.errors import GeometryError
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.planning import plan

MESH = named_part("block-a").top_mesh(4.0)


def technique(**changes) -> Technique:
    return Technique.model_validate({"plan": {"pitch_mm": 12.0, "step_mm": 12.0} | changes})


def made(vertices, faces):
    return SurfaceMesh.from_triangles(np.asarray(vertices, float), np.asarray(faces, np.int64))


@pytest.fixture(scope="module")
def whole():
    return plan(MESH, technique())


@pytest.mark.parametrize(
    ("mesh", "settings", "message"),
    [
        (made(MESH.vertices / 1000, MESH.faces), {}, r"mesh is 0\.2 mm long .* probably metres\. Multiply it by 1000"),
        (made(MESH.vertices * 1000, MESH.faces), {}, r"2e\+05 mm long .* probably micrometres\. Divide it by 1000"),
        (MESH, {"pitch_mm": 500.0}, r"pitch_mm 500 exceeds the part, which is 200\.0 mm long\. Lower pitch_mm"),
        (MESH, {"step_mm": 500.0}, r"step_mm 500 exceeds the part"),
        (MESH, {"pitch_mm": 0.001}, r"over 50000 rows\. Raise pitch_mm"),
        (MESH, {"margin_mm": 60.0}, r"nothing is left to scan: margin 60 mm.* Lower the margin"),
        (made(MESH.vertices * (1, 0, 0), MESH.faces), {}, r"none of the mesh's \d+ faces has an area"),
        (made(MESH.vertices[:, [0, 2, 1]] * (1, 1, 9), MESH.faces), {}, r"no piece of the surface can be scanned"),
    ],
)
def test_refused_with_the_reason_and_the_way_out(mesh, settings, message):
    with pytest.raises(GeometryError, match=message):
        plan(mesh, technique(**settings))


def crumbs(n=50):
    random = np.random.default_rng(4)
    at = np.repeat(random.uniform((0, 0, 60), (200, 100, 90), (n, 3)), 3, axis=0)
    loose = at + np.tile([[0, 0, 0], [1, 0, 0], [0, 1, 0]], (n, 1))
    faces = np.arange(3 * n).reshape(-1, 3) + len(MESH.vertices)
    return made(np.concatenate([MESH.vertices, loose]), np.concatenate([MESH.faces, faces]))


def some_turned():
    faces = MESH.faces.copy()
    turn = np.random.default_rng(5).random(len(faces)) < 0.3
    faces[turn] = faces[turn][:, ::-1]
    return made(MESH.vertices, faces)


def with_slivers():
    # Each border vertex gets a twin a micrometre away, and a face between them.
    edge = np.flatnonzero(MESH.vertices[:, 1] == 0)
    edge = edge[np.argsort(MESH.vertices[edge, 0])]
    twins = MESH.vertices[edge] + (0, -1e-6, 0)
    number = len(MESH.vertices) + np.arange(len(edge))
    slivers = np.stack([number[:-1], edge[1:], edge[:-1]], axis=1)
    return made(np.concatenate([MESH.vertices, twins]), np.concatenate([MESH.faces, slivers]))


@pytest.mark.parametrize(
    ("mesh", "note"),
    [
        (made(MESH.vertices, MESH.faces[:, ::-1]), r"1 of 1 pieces looked inwards or down and were turned over"),
        (some_turned(), r"\d+ faces turned to agree with their neighbours"),
        (
            made(MESH.vertices[MESH.faces].reshape(-1, 3), np.arange(3 * len(MESH.faces)).reshape(-1, 3)),
            r"doubled vertices",
        ),
        (crumbs(), r"50 loose pieces of together 25\.0 mm\^2 left out"),
        (with_slivers(), r"faces without area left out"),
        (made(MESH.vertices, np.concatenate([MESH.faces, MESH.faces[:7]])), r"7 faces given twice left out"),
    ],
    ids=["inverted", "inconsistent", "soup", "crumbs", "slivers", "doubled"],
)
def test_repaired_by_name_and_planned_as_if_whole(mesh, note, whole):
    result = plan(mesh, technique())
    assert any(re.search(note, told) for told in result.notes), result.notes
    assert result.n_scan == whole.n_scan
    assert result.coverage.swept > 0.999


def test_a_fin_on_an_edge_is_cut_off_and_the_probe_stays_out_of_its_way():
    a, b = MESH.faces[1500, :2]
    top = MESH.vertices[[a, b]].mean(axis=0) + np.array([0.0, 0.0, 12.0])
    mesh = made(np.concatenate([MESH.vertices, top[None]]), np.concatenate([MESH.faces, [[a, b, len(MESH.vertices)]]]))
    result = plan(mesh, technique(), allow_gaps=True)
    assert any("shared by more than two faces" in told for told in result.notes)
    assert result.lift_off_mm[result.is_scan].max() <= 1.5


def test_two_sheets_that_cross_are_read_only_where_the_upper_one_is():
    plate = named_part("plate").top_mesh(4.0)
    tilt = 0.2 * (plate.vertices[:, 0] - 101.3)
    sheets = [plate.vertices + np.outer(sign * tilt, (0, 0, 1)) for sign in (1, -1)]
    mesh = made(np.concatenate(sheets), np.concatenate([plate.faces, plate.faces + len(plate.vertices)]))
    result = plan(mesh, technique(), allow_gaps=True)
    x, z = result.surface_mm[result.is_scan][:, [0, 2]].T
    assert (z > 30 + 0.2 * np.abs(x - 101.3) - 0.6).all()
    assert any(
        zone.reason == "hidden from above" or "out of reach" in zone.reason for zone in result.coverage.uncovered
    )


def sunk_plate(depth_mm, width_mm):
    mesh = named_part("plate").top_mesh(1.0)
    valley = depth_mm * np.exp(-(((mesh.vertices[:, 0] - 100) / width_mm) ** 2))
    x, y = mesh.vertices[mesh.faces].mean(axis=1)[:, :2].T
    return made(mesh.vertices - np.outer(valley, (0, 0, 1)), mesh.faces[(np.abs(x - 100) < 40) & (y < 40)])


def test_a_slit_is_not_read():
    result = plan(sunk_plate(8.0, 1.2), technique(step_mm=3.0), allow_gaps=True)
    assert result.lift_off_mm[result.is_scan].max() <= 1.5
    # Its shoulders can be read, its floor 8 mm down cannot.
    assert result.surface_mm[result.is_scan, 2].min() > 30 - 4


def test_two_triangles_of_a_drawn_plate_are_enough():
    mesh = made([[0, 0, 30], [200, 0, 30], [200, 100, 30], [0, 100, 30]], [[0, 1, 2], [0, 2, 3]])
    result = plan(mesh, technique(margin_mm=0.0))
    assert result.coverage.swept > 0.999
    np.testing.assert_allclose(result.normal[result.is_scan], [[0, 0, 1]] * result.n_scan, atol=1e-9)
