"""The manual crop keeps what lies inside its limits."""

from __future__ import annotations

import pytest

from eddyscan.core.errors import TechniqueError
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Crop
from eddyscan.surface.crop import cropped


def test_a_crop_keeps_the_inside():
    mesh = cropped(named_part("block-a").top_mesh(5.0), Crop(x_mm=(50.0, 120.0), y_mm=(-60.0, 24.0)))
    assert mesh.vertices[:, 0].min() >= 50.0
    assert mesh.vertices[:, 1].max() <= 24.0
    assert mesh.area_mm2 > 0.6 * 70 * 24


def test_rotation_comes_before_the_limits():
    turned = cropped(named_part("plate").top_mesh(10.0), Crop(rotate_xyz_deg=(0.0, 0.0, 90.0)))
    assert turned.vertices[:, 1].max() == pytest.approx(200.0)


def test_a_crop_that_leaves_nothing_names_the_extent():
    with pytest.raises(TechniqueError, match=r"leaves nothing of the surface, which spans x 0 to 200"):
        cropped(named_part("plate").top_mesh(20.0), Crop(z_mm=(500.0, 600.0)))
