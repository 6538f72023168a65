"""What must hold for every input: projection, splines, grids, comparison."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.depth import PinholeCamera
from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import apply, from_rotation_vector
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.surface.compare import compare
from eddyscan.surface.deproject import deproject, project
from eddyscan.surface.grid_mesh import inside_polygon, mesh_inside
from eddyscan.surface.spline import GridFit, SplineBasis, uniform_weights
from eddyscan.surface.weak import refuse_slides

CAMERA = PinholeCamera(fx=83.3, fy=80.0, cx=31.2, cy=22.9, width=64, height=46, depth_scale_mm=0.1)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31))
def test_deproject_and_project_invert_each_other(seed):
    rng = np.random.default_rng(seed)
    depth = rng.uniform(200, 600, (46, 64))
    depth[rng.random(depth.shape) < 0.3] = np.nan
    pixels = project(deproject(depth, CAMERA), CAMERA)
    rows, columns = np.nonzero(np.isfinite(depth))
    assert pixels == pytest.approx(np.stack([columns, rows], axis=1), abs=1e-9)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.1, 10))
def test_the_banded_fit_is_the_dense_penalised_least_squares_fit(seed, smoothing):
    rng = np.random.default_rng(seed)
    x, y = np.arange(12) + 0.5, np.arange(9) + 0.5
    fit = GridFit(x, y, SplineBasis(0, 12, 4), SplineBasis(0, 9, 3))
    weight, height = rng.random((12, 9)) + 0.1, rng.standard_normal((12, 9))
    B = np.kron(fit.Bx, fit.By)
    kx, ky = fit.basis_x.size, fit.basis_y.size

    def square(n, order):
        D = np.diff(np.eye(n), order, axis=0)
        return D.T @ D

    penalty = np.kron(square(kx, 2), np.eye(ky)) + np.kron(np.eye(kx), square(ky, 2))
    penalty += 2 * np.kron(square(kx, 1), square(ky, 1))
    fit.hold(uniform_weights(kx, ky))
    H = B.T @ (weight.ravel()[:, None] * B) + smoothing * penalty
    dense = np.linalg.solve(H, B.T @ (weight * height).ravel())
    assert fit.solve(weight, height, smoothing)[0].ravel() == pytest.approx(dense, abs=1e-4)


def test_a_plane_is_reproduced_whatever_the_smoothing():
    x, y = np.arange(20) + 0.5, np.arange(15) + 0.5
    fit = GridFit(x, y, SplineBasis(0, 20, 6), SplineBasis(0, 15, 5))
    plane = 3 + 0.4 * x[:, None] - 0.2 * y[None]
    c, _ = fit.solve(np.ones_like(plane), plane, 1e3)
    assert np.abs(fit.Bx @ c @ fit.By.T - plane).max() < 1e-3


@settings(max_examples=15, deadline=None)
@given(st.floats(20, 60), st.floats(15, 40), st.floats(-20, 20), st.floats(0.7, 2.0))
def test_a_mesh_fills_its_outline_and_stays_inside(length, width, skew, grid):
    outline = np.array([[0, 0], [length, 0], [length + skew, width], [skew, width]])
    xy, faces = mesh_inside(outline, grid)
    a, b, c = (xy[faces[:, k]] for k in range(3))
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert (area > 0).all()
    assert area.sum() == pytest.approx(length * width, rel=0.03)
    middle = outline.mean(axis=0)
    assert inside_polygon(middle + (xy - middle) * 0.995, outline).all()


def test_compare_finds_a_known_shift_and_takes_it_out():
    part = named_part("block-a")
    T = from_rotation_vector(np.array([0.001, -0.002, 0.0]), np.array([0.3, 0.0, 0.4]))
    exact = part.top_mesh(3.0)
    moved = SurfaceMesh(apply(T, exact.vertices), exact.faces, exact.normals)
    result = compare(moved, part)
    assert result.own.mean_abs_mm > 0.2
    assert result.fit.rmse_mm < 1e-3
    assert (result.own.aligned, result.fit.aligned) == (False, True)


def test_compare_with_a_mesh_agrees_with_the_exact_part():
    part = named_part("block-c")
    shifted = part.top_mesh(4.0)
    shifted = SurfaceMesh(shifted.vertices + np.array([0, 0, 0.2]), shifted.faces, shifted.normals)
    exact, meshed = compare(shifted, part).own, compare(shifted, part.top_mesh(1.0)).own
    assert meshed.mean_abs_mm == pytest.approx(exact.mean_abs_mm, abs=0.01)


def test_compare_refuses_a_mesh_that_lies_elsewhere():
    far = named_part("plate").top_mesh(20.0)
    far = SurfaceMesh(far.vertices + np.array([5000.0, 0, 0]), far.faces, far.normals)
    with pytest.raises(GeometryError, match="no vertex of the mesh lies over the nominal surface"):
        compare(far, named_part("plate"))


def test_slides_are_warned_of_or_refused_by_name():
    from eddyscan.core.errors import RegistrationError

    assert refuse_slides({"view-2": ("slides along y by +-1.2 mm",)})[0].startswith("view-2 slides along y")
    with pytest.raises(RegistrationError, match=r"view-2 slides along y by \+-6.0 mm \(limit \+-4 mm\)"):
        refuse_slides({"view-2": ("slides along y by +-6.0 mm",)})
