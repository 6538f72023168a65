"""The plan as a whole: what holds on every named part."""

import numpy as np
import pytest

from eddyscan.core.errors import CoverageError, GeometryError
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.planning import plan


def technique(**settings) -> Technique:
    return Technique.model_validate({"plan": settings})


def test_adaptive_sampling_puts_forty_odd_points_in_each_row_of_block_a():
    result = plan(named_part("block-a").top_mesh(1.0), technique(strategy="adaptive", margin_mm=0.0))
    rows = np.bincount(result.row[result.is_scan])
    assert result.n_rows == 20
    assert set(rows.tolist()) == {42}
    assert np.abs(np.asarray(result.coverage.spacing_mm) - 5.0).max() < 0.05


@pytest.mark.parametrize("name", ["block-a", "block-c", "blade", "plate"])
def test_poses_stand_off_the_true_surface_by_the_predicted_lift_off(name):
    part = named_part(name)
    result = plan(part.top_mesh(1.0), technique(strategy="adaptive"))
    scan = result.is_scan
    _, normal, distance = part.closest(result.T_part_probe[scan, :3, 3])
    np.testing.assert_allclose(distance, result.lift_off_mm[scan], atol=0.02)
    tilt = np.degrees(np.arccos(-np.einsum("nk,nk->n", normal, result.T_part_probe[scan, :3, 2])))
    np.testing.assert_allclose(tilt, result.tilt_deg[scan], atol=0.5)


def test_a_gap_wider_than_the_technique_allows_is_refused_unless_allowed():
    mesh = named_part("dome").top_mesh(2.0)
    settings = technique(strategy="grid", machine="pose", margin_mm=0.0)
    with pytest.raises(CoverageError, match=r"sweeps \d+\.\d % .* demands 95\.0 %; the largest gap is .* allow gaps"):
        plan(mesh, settings)
    assert plan(mesh, settings, allow_gaps=True).coverage.swept < 0.95


def test_what_the_axes_cannot_reach_is_left_out_and_listed():
    result = plan(named_part("dome").top_mesh(1.0), technique(strategy="adaptive"), travel_mm=(200.0, 200.0, 40.0))
    reasons = {u.reason: u.area_mm2 for u in result.coverage.uncovered}
    assert reasons["out of reach of the axes"] > 1000
    assert np.ptp(result.T_part_probe[:, 2, 3]) <= 40.0


def test_a_margin_that_eats_the_part_is_refused():
    with pytest.raises(GeometryError, match=r"nothing is left to scan: margin 60 mm"):
        plan(named_part("plate").top_mesh(2.0), technique(margin_mm=60.0))


def test_only_the_drawn_regions_are_scanned_each_kept_apart():
    regions = [[(20, 20), (60, 20), (60, 60), (20, 60)], [(120, 40), (180, 40), (150, 90)]]
    result = plan(named_part("block-a").top_mesh(1.0), technique(regions_mm=regions))
    x, y = result.surface_mm[result.is_scan, :2].T
    square = (x > 19.9) & (x < 60.1) & (y > 19.9) & (y < 60.1)
    triangle = (y > 39.9) & (y < 90.1) & (x > 119.9) & (x < 180.1)
    assert (square ^ triangle).all()
    assert square.any()
    assert triangle.any()
    for row in np.unique(result.row):
        own = result.is_scan & (result.row == row)
        assert len({bool(x > 90) for x in result.surface_mm[own, 0]}) == 1
    assert result.coverage.swept > 0.99
    with pytest.raises(ValueError, match=r"regions_mm\[0\] has 2 corners, an outline needs at least 3"):
        technique(regions_mm=[[(0, 0), (1, 1)]])


def test_encircling_a_dome_keeps_rings_a_pitch_apart_on_the_surface():
    result = plan(
        named_part("dome").top_mesh(1.0), technique(strategy="encircle", machine="pose", margin_mm=3.0), allow_gaps=True
    )
    assert result.coverage.swept > 0.995
    assert result.coverage.row_distance_mm[2] < 5.5
