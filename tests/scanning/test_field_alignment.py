import numpy as np
import pytest

from eddyscan.core.errors import GeometryError, LinkError, TechniqueError
from eddyscan.core.frames import transform
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Probe, Technique
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.sim.world_settings import WorldPlacement, WorldSettings
from eddyscan.scanning.field_alignment import align, scaled

from .field_cell import FieldCell, pose_error


def cell_of(part, seed=1):
    settings = WorldSettings(part=part, seed=seed, flaws="none", placement=WorldPlacement(alignment="rough"))
    return FieldCell(settings, VirtualClock())


def aligned(cell, mesh, technique=None, T=None, **options):
    return align(
        mesh,
        technique or Technique(),
        stage=cell,
        instrument=cell,
        clock=cell.clock,
        T_stage_part=cell.rough if T is None else T,
        **options,
    )


@pytest.mark.parametrize(("part", "seed", "camera_scale"), [("block-a", 5, 1.002), ("block-c", 2, 0.998)])
def test_the_part_is_found_from_a_rough_corner(part, seed, camera_scale):
    cell = cell_of(part, seed)
    found = aligned(cell, scaled(named_part(part).top_mesh(1.0), camera_scale))
    error = pose_error(cell, found.T_stage_part)
    assert error["z_mm"] < 0.020
    assert error["tilt_deg"] < 0.05
    assert error["in_plane_mm"] < 0.2
    assert found.scale * camera_scale == pytest.approx(1.0, abs=5e-4)
    assert found.duration_s < 60.0
    assert cell.lowest_gap_mm > 0.3
    assert cell.at[2] == cell.axes()[2].upper


def test_a_sphere_tells_that_it_can_turn():
    cell = cell_of("dome")
    found = aligned(cell, named_part("dome").top_mesh(2.0), contacts=6)
    assert any("turns about z" in weak for weak in found.weak_directions)
    assert found.residual_mm < 0.01


def test_no_metal_where_the_corner_says():
    cell = cell_of("block-a")
    beside = transform(None, (0.0, 130.0, 0.0)) @ cell.rough
    with pytest.raises(GeometryError, match=r"no metal under x = .* y = .* down to z = .*Jog to the part's corner"):
        aligned(cell, named_part("block-a").top_mesh(2.0), T=beside)
    assert cell.stops == 1


def test_another_coil_is_noticed_in_air():
    cell = cell_of("block-a")
    thick = Technique(probe=Probe(outer_radius_mm=2.5))
    with pytest.raises(TechniqueError, match=r"ohm of reactance in air.*limit 20 %.*dimensions and turns"):
        aligned(cell, named_part("block-a").top_mesh(4.0), thick)


def test_a_lost_instrument_ends_with_the_probe_lifted():
    cell = cell_of("block-a")
    healthy, left = cell.read, [30]

    def failing():
        left[0] -= 1
        if left[0] < 0:
            raise LinkError("the instrument does not answer")
        return healthy()

    cell.read = failing
    with pytest.raises(LinkError):
        aligned(cell, named_part("block-a").top_mesh(2.0))
    assert cell.stops == 1
    assert cell.at[2] == cell.axes()[2].upper


def test_nothing_drops_into_the_part_from_any_corner():
    for seed in (6, 7):
        cell = cell_of("block-a", seed)
        aligned(cell, named_part("block-a").top_mesh(2.0), contacts=5, crossings=2)
        assert cell.lowest_gap_mm > 0.3
        assert np.isfinite(cell.at).all()
