"""Views of a part on a cluttered table, no guess: surface, poses and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from views_of_parts import part_views

from eddyscan.core.cloud import PointCloud
from eddyscan.core.errors import GeometryError, RegistrationError
from eddyscan.core.frames import angle_deg, invert
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Surface
from eddyscan.surface import compare, reconstruct

SETTINGS = Surface()


@cache
def block():
    views, _ = part_views("block-c")
    return reconstruct(views, SETTINGS)


def test_block_c_is_measured_within_the_bars():
    result = compare(block().mesh, named_part("block-c"))
    assert result.own.mean_abs_mm < 0.10
    assert result.fit.rmse_mm < 0.06
    assert result.own.coverage > 0.98
    assert block().method == "height field"


def test_poses_agree_with_each_other_as_the_true_ones_do():
    _, poses = part_views("block-c")
    errors = [r.T_target_source @ invert(T) for r, T in zip(block().registrations, poses, strict=True)]
    for e in errors:
        assert angle_deg(invert(errors[0]) @ e) < 0.3
        middle = np.array([100.0, 50.0, 30.0, 1.0])
        assert np.linalg.norm((e - errors[0]) @ middle) < 0.6


def test_stated_uncertainty_holds_and_is_not_boundless():
    mesh = block().mesh
    deviation = compare(mesh, named_part("block-c")).fit.signed_mm
    known = np.isfinite(deviation)
    share = np.mean(np.abs(deviation[known]) < 1.96 * mesh.uncertainty_mm[known])
    assert share > 0.88
    assert np.median(mesh.uncertainty_mm) < 0.12


def test_the_frame_is_the_part_s():
    vertices = block().mesh.vertices
    assert vertices[:, :2].min(axis=0) == pytest.approx([0.0, 0.0], abs=0.3)
    assert np.ptp(vertices[:, 0]) > np.ptp(vertices[:, 1])
    assert block().cloud.frame == "part"
    assert len(block().cloud) <= 200_000


def test_a_view_of_another_part_is_left_out_by_name():
    views = list(part_views("block-c")[0][:3])
    stranger = replace(part_views("dome")[0][0], name="stranger")
    result = reconstruct([*views, stranger], SETTINGS)
    assert any(w.startswith("stranger left out: disagrees by") for w in result.warnings)
    assert not result.registrations[3].converged


def test_given_poses_are_kept():
    views, poses = part_views("block-c")
    posed = [replace(v, T_world_camera=T) for v, T in zip(views, poses, strict=True)]
    result = reconstruct(posed, SETTINGS)
    assert {r.source for r in result.registrations} == {"given"}
    errors = [r.T_target_source @ invert(T) for r, T in zip(result.registrations, poses, strict=True)]
    assert max(np.abs(e - errors[0]).max() for e in errors) < 1e-6


def _empty(view):
    return replace(view, depth_mm=np.full_like(view.depth_mm, np.nan), name="empty")


@pytest.mark.parametrize(
    ("views", "error", "message"),
    [
        (lambda v: [], RegistrationError, "0 view given, at least 2 are needed"),
        (lambda v: v[:1], RegistrationError, "1 view given, at least 2 .*--single-view"),
        (lambda v: [v[0], _empty(v[1])], GeometryError, "empty holds no depth at all"),
        (
            lambda v: [replace(x, depth_mm=x.depth_mm / 1000) for x in v],
            GeometryError,
            "looks like metres: check depth_scale_mm",
        ),
        (lambda v: [v[0], v[0]], RegistrationError, "are the same picture, number by number"),
        (
            lambda v: [replace(v[0], T_world_camera=np.eye(4)), v[1]],
            RegistrationError,
            "1 of 2 views carry a pose, view-1 carry none",
        ),
        (
            lambda v: [PointCloud(np.repeat([[1.0, 2.0, 300.0]], 100_000, axis=0), name="dots"), v[0]],
            GeometryError,
            "dots: its 100000 points lie in one direction",
        ),
        (lambda v: [PointCloud(np.ones((10, 3)), name="few"), v[0]], GeometryError, r"few has 10 points \(need 1000\)"),
    ],
)
def test_bad_views_are_refused_with_the_way_out(views, error, message):
    with pytest.raises(error, match=message):
        reconstruct(views(list(part_views("block-c")[0][:2])), SETTINGS)
