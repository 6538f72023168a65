"""Finding the part by touch."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import angle_deg, apply, from_rotation_vector, invert
from eddyscan.scanning import align_from_corner, align_from_points

CORNERS = np.array([[0.0, 0.0, 30.0], [200.0, 0.0, 30.0], [0.0, 100.0, 30.0]])
small = st.floats(-0.3, 0.3)
far = st.floats(-200.0, 200.0)


def test_a_corner_places_the_part_along_the_axes():
    found = align_from_corner(np.array([10.0, 20.0, 35.0]), np.array([0.0, 0.0, 30.0]))
    assert apply(found.T_stage_part, np.array([[0.0, 0.0, 30.0]]))[0] == pytest.approx([10.0, 20.0, 35.0])
    assert np.allclose(found.T_stage_part[:3, :3], np.eye(3))
    assert found.uncertainty_mm > 0
    assert found.uncertainty_deg > 0


@given(st.tuples(small, small, small), st.tuples(far, far, far))
def test_exact_touches_give_the_exact_pose(turn, shift):
    T = from_rotation_vector(np.array(turn), np.array(shift))
    found = align_from_points(apply(T, CORNERS), CORNERS)
    assert np.allclose(found.T_stage_part, T, atol=1e-8)
    assert found.residual_mm < 1e-8


def test_the_stated_uncertainty_is_the_scatter_of_many_operators():
    rng, T = np.random.default_rng(3), from_rotation_vector(np.array([0.01, -0.02, 0.1]), np.array([5.0, 6.0, 7.0]))
    middle = CORNERS.mean(axis=0)[None]
    position, turn, stated = [], [], None
    for _ in range(300):
        touched = apply(T, CORNERS) + rng.normal(0, 0.05, CORNERS.shape)
        stated = align_from_points(touched, CORNERS, touch_mm=0.05)
        position.append(apply(stated.T_stage_part, middle)[0] - apply(T, middle)[0])
        turn.append(angle_deg(invert(T) @ stated.T_stage_part))
    assert np.std(position) == pytest.approx(0.05 / np.sqrt(3), rel=0.1)
    assert stated.uncertainty_mm == pytest.approx(0.05 / np.sqrt(3), rel=0.6)
    rms_turn = np.sqrt(np.mean(np.square(turn)) / 3)
    assert rms_turn == pytest.approx(
        align_from_points(apply(T, CORNERS), CORNERS, touch_mm=0.05).uncertainty_deg, rel=0.15
    )


def test_swapped_points_are_refused():
    with pytest.raises(GeometryError, match=r"residual \d+\.\d\d mm \(limit 0\.40\), worst at point \d"):
        align_from_points(CORNERS, CORNERS[[1, 0, 2]])


def test_points_on_a_line_are_refused():
    line = np.array([[0.0, 0, 0], [50.0, 0, 0], [100.0, 0.1, 0]])
    with pytest.raises(GeometryError, match=r"lie on a line.*Touch a third point to the side"):
        align_from_points(line, line)


def test_two_points_are_refused():
    with pytest.raises(GeometryError, match="2 touched and 2 part points; three or more"):
        align_from_points(CORNERS[:2], CORNERS[:2])


def test_an_alignment_goes_into_a_record():
    note = align_from_points(CORNERS, CORNERS).note()
    assert json.loads(json.dumps(note))["method"] == "points"
