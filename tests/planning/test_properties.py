"""What must hold for every plan: it moves with the part, repeats itself, and does not hang on the mesh."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from eddyscan.core.frames import apply, from_rotation_vector, rotate
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.planning import plan

PITCH_MM = 15.0


def technique(**changes) -> Technique:
    base = {"machine": "pose", "pitch_mm": PITCH_MM, "step_mm": PITCH_MM, "margin_mm": 4.0}
    return Technique.model_validate({"plan": base | changes})


def test_moving_and_turning_the_part_moves_the_plan_along():
    mesh = named_part("blade").top_mesh(3.0)
    before = plan(mesh, technique())

    @settings(max_examples=6, deadline=None)
    @given(st.tuples(*[st.floats(-0.25, 0.25)] * 2, st.floats(-3, 3)), st.tuples(*[st.floats(-300, 300)] * 3))
    def moved(turn, shift):
        T = from_rotation_vector(np.array(turn), np.array(shift))
        after = plan(mesh.moved(T, "part"), technique())
        assert after.n_rows == before.n_rows
        spots, normals = apply(T, before.surface_mm[before.is_scan]), rotate(T, before.normal[before.is_scan])
        far, match = KDTree(after.surface_mm[after.is_scan]).query(spots)
        assert far.max() < 1e-3
        np.testing.assert_allclose(after.normal[after.is_scan][match], normals, atol=1e-4)

    moved()


@pytest.mark.parametrize("strategy", ["geodesic", "adaptive", "grid", "encircle"])
def test_planning_twice_gives_the_same_plan(strategy):
    mesh = named_part("block-a").top_mesh(3.0)
    one, two = (plan(mesh, technique(strategy=strategy), allow_gaps=True) for _ in range(2))
    np.testing.assert_array_equal(one.T_part_probe, two.T_part_probe)
    np.testing.assert_array_equal(one.time_s, two.time_s)
    assert one.coverage == two.coverage


@pytest.mark.parametrize("name", ["block-c", "dome", "blade"])
def test_every_pose_is_reached_once_in_running_order(name):
    result = plan(named_part(name).top_mesh(3.0), technique(), allow_gaps=True)
    scan = result.is_scan
    pairs = np.stack([result.row[scan], result.point[scan]], axis=1)
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    for row in np.unique(result.row):
        own = scan & (result.row == row)
        np.testing.assert_array_equal(result.point[own], np.arange(own.sum()))
        assert (np.diff(result.s_mm[own]) > 0).all()
        # Only the last reading of a closed row stands where another stands.
        spots = result.surface_mm[own]
        assert np.linalg.norm(spots[1:] - spots[:-1], axis=1).min() > 0.1 * PITCH_MM
    assert (np.diff(result.time_s) >= 0).all()


def test_a_finer_mesh_gives_the_same_plan_within_the_meshes_error():
    part = named_part("block-c")
    coarse, fine = (plan(part.top_mesh(edge), technique()) for edge in (2.0, 1.0))
    assert coarse.n_scan == fine.n_scan
    far = KDTree(fine.surface_mm[fine.is_scan]).query(coarse.surface_mm[coarse.is_scan])[0]
    assert far.max() < 0.05


def test_the_probe_frame_is_right_handed_and_looks_into_the_part():
    result = plan(named_part("dome").top_mesh(3.0), technique(), allow_gaps=True)
    R = result.T_part_probe[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-9)
    scan = result.is_scan
    np.testing.assert_allclose(R[scan][:, :, 2], -result.normal[scan], atol=1e-9)
    np.testing.assert_allclose(
        result.surface_mm[scan], result.T_part_probe[scan, :3, 3] + 0.5 * R[scan][:, :, 2], atol=1e-9
    )


def test_links_keep_clear_of_the_part():
    part = named_part("block-c")
    mesh = part.top_mesh(2.0)
    for machine in ("xyz", "pose"):
        result = plan(mesh, technique(machine=machine), allow_gaps=True)
        way = result.T_part_probe[:, :3, 3]
        link = ~(result.is_scan[1:] & result.is_scan[:-1])
        t = np.linspace(0, 1, 21)[:, None]
        spots = np.concatenate([a + t * (b - a) for a, b in zip(way[:-1][link], way[1:][link], strict=True)])
        # The surface is a height field: what is above it is free.
        height = spots[:, 2] - 30 - 15 * np.sin(2 * np.pi * spots[:, 0] / 140)
        assert height.min() > 0.3


def test_adaptive_density_spends_its_points_where_the_surface_curves():
    mesh = named_part("block-c").top_mesh(1.0)
    result = plan(mesh, technique(density="adaptive", pitch_mm=20.0, step_mm=5.0, chord_error_mm=0.05), allow_gaps=True)
    first = result.is_scan & (result.row == 0)
    x, step = result.surface_mm[first, 0], np.diff(result.s_mm[first])
    phase = 2 * np.pi * (x[1:] + x[:-1]) / 2 / 140
    slope = 15 * 2 * np.pi / 140 * np.cos(phase)
    curvature = np.abs(15 * (2 * np.pi / 140) ** 2 * np.sin(phase)) / (1 + slope**2) ** 1.5
    sag = step**2 * curvature / 8
    assert sag.max() < 1.3 * 0.05
    assert step[curvature < 0.004].mean() > 1.5 * step[curvature > 0.025].mean()


def test_a_bent_tube_closed_all_round_is_covered_by_closed_rows():
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    x = np.linspace(0, 60, 31)
    X, A = np.meshgrid(x, angle, indexing="ij")
    vertices = np.stack([X, 20 * np.cos(A), 20 * np.sin(A) + 0.01 * X**2], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(30), np.arange(90), indexing="ij")
    p, q, r, s = i * 90 + j, (i + 1) * 90 + j, (i + 1) * 90 + (j + 1) % 90, i * 90 + (j + 1) % 90
    faces = np.concatenate([np.stack([p, q, r], -1).reshape(-1, 3), np.stack([p, r, s], -1).reshape(-1, 3)])
    result = plan(SurfaceMesh.from_triangles(vertices, faces), technique(pitch_mm=6.0, step_mm=6.0, margin_mm=0.0))
    assert result.coverage.swept > 0.995
    rows = [result.surface_mm[result.is_scan & (result.row == row)] for row in np.unique(result.row)]
    closed = [bool(np.allclose(own[0], own[-1])) for own in rows]
    # The far end is no row: short rows fill the wedge there.
    assert sum(closed) >= 9
    assert all(len(own) < 25 for own, shut in zip(rows, closed, strict=True) if not shut)
