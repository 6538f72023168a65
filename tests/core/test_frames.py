"""Transforms form a group and name what is wrong with a bad one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import angle_deg, apply, checked_transform, from_rotation_vector, invert, rotate

numbers = st.floats(-3, 3)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
transforms = st.builds(lambda r, t: from_rotation_vector(r, 100 * t), vectors, vectors)


@given(transforms)
def test_inverse_cancels(T: np.ndarray) -> None:
    np.testing.assert_allclose(T @ invert(T), np.eye(4), atol=1e-9)
    np.testing.assert_allclose(invert(invert(T)), T, atol=1e-9)


@given(transforms, transforms, vectors)
def test_applying_twice_is_applying_the_product(T_a_b: np.ndarray, T_b_c: np.ndarray, point: np.ndarray) -> None:
    points_c = point[None]
    np.testing.assert_allclose(apply(T_a_b, apply(T_b_c, points_c)), apply(T_a_b @ T_b_c, points_c), atol=1e-9)


@given(transforms, vectors)
def test_a_rotation_keeps_length(T: np.ndarray, v: np.ndarray) -> None:
    assert np.linalg.norm(rotate(T, v[None])) == pytest.approx(np.linalg.norm(v), abs=1e-9)


def test_angle_is_that_of_the_rotation_vector() -> None:
    assert angle_deg(from_rotation_vector(np.radians([0.0, 30.0, 0.0]), np.zeros(3))) == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.eye(3), "has shape"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "determinant -1"),
        (np.diag([2.0, 1.0, 1.0, 1.0]), "differs from 1 by 3"),
        (np.full((4, 4), np.nan), "NaN"),
    ],
)
def test_a_bad_transform_is_named(matrix: np.ndarray, words: str) -> None:
    with pytest.raises(GeometryError, match=words):
        checked_transform(matrix, "T_part_view")
