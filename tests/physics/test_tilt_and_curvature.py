import numpy as np
import pytest
from scipy.special import ellipe, ellipk, spherical_jn

from benchmarks.physics_references import (
    bessel_ratio,
    coil_over_perfect_conductor_h,
    coil_over_sphere_ohm,
    loop_mutual_h,
)
from eddyscan.core.errors import TechniqueError
from eddyscan.physics import (
    Coil,
    Conductor,
    curved_lift_off_mm,
    effective_radius_mm,
    impedance_change_ohm,
    impedance_ohm,
    least_lift_off_mm,
    skin_depth_mm,
    too_curved,
)
from eddyscan.physics.coil import MU0
from eddyscan.physics.sound_response import sound_response

PENCIL = Coil(0.5, 1.5, 1.0, 100)
ALUMINIUM = Conductor.half_space(19.0)


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 30.0])
def test_tilted_coil_equals_neumanns_integral_over_a_perfect_conductor(tilt_deg):
    coil = Coil(1.0, 1.5, 0.6, 1)
    perfect = Conductor.half_space(60.0)
    frequency = 1e15  # a skin depth of nothing, inside the coil's own formulas
    lift_off = least_lift_off_mm(coil, tilt_deg) + 0.5
    change = complex(impedance_change_ohm(coil, perfect, frequency, lift_off, tilt_deg))
    expected = coil_over_perfect_conductor_h(coil, lift_off, tilt_deg)
    assert change.imag / (2 * np.pi * frequency) == pytest.approx(expected, rel=1e-4)


def test_no_tilt_is_the_upright_formula():
    upright = impedance_change_ohm(PENCIL, ALUMINIUM, 5e5, 0.3)
    assert abs(impedance_change_ohm(PENCIL, ALUMINIUM, 5e5, 0.3, 1e-7) / upright - 1) < 1e-9


def test_tilt_is_even():
    a, b = (impedance_change_ohm(PENCIL, ALUMINIUM, 5e5, 0.5, tilt) for tilt in (12.0, -12.0))
    assert a == b


def test_a_rim_in_the_metal_is_refused():
    with pytest.raises(TechniqueError, match=r"lift_off_mm = 0\.1 .* at least 0\.513"):
        impedance_ohm(PENCIL, ALUMINIUM, 5e5, 0.1, 20.0)
    with pytest.raises(TechniqueError, match=r"tilt_deg = 85: must lie between -80 and 80 deg"):
        impedance_ohm(PENCIL, ALUMINIUM, 5e5, 2.0, 85.0)


@pytest.fixture(scope="module")
def response():
    return sound_response(PENCIL, ALUMINIUM, 5e5, largest_lift_off_mm=3.0, largest_tilt_deg=27.0)


@pytest.mark.parametrize("tilt_deg", [0.0, 4.3, 17.0, 26.0])
def test_the_table_over_lift_off_and_tilt_equals_the_integral(response, tilt_deg):
    h = least_lift_off_mm(PENCIL, tilt_deg) + np.random.default_rng(3).uniform(0.0, 2.0, 20)
    exact = impedance_ohm(PENCIL, ALUMINIUM, 5e5, h, tilt_deg)
    found = response.impedance_ohm(h, np.full(20, tilt_deg))
    assert np.abs(found - exact).max() < 3e-5 * response.reactance_air_ohm


def test_bessel_ratio_of_the_check():
    x = 3.0 - 2.0j
    assert bessel_ratio(4, x) == pytest.approx(spherical_jn(5, x) / spherical_jn(4, x))


@pytest.mark.parametrize(("radius_mm", "limit_um"), [(50.0, 1.0), (25.0, 2.0), (15.0, 4.0)])
def test_curvature_as_lift_off_against_the_exact_sphere(radius_mm, limit_um):
    skin = skin_depth_mm(19.0, 5e5)
    lift_off = 0.3
    sphere = coil_over_sphere_ohm(
        PENCIL, radius_mm, lift_off, frequency_hz=5e5, sigma_s_m=19e6, terms=int(24 * radius_mm)
    )
    h = np.linspace(0.25, 0.6, 701)
    flat = impedance_change_ohm(PENCIL, ALUMINIUM, 5e5, h)
    reads_like = h[np.abs(flat - sphere).argmin()]
    predicted = curved_lift_off_mm(PENCIL, lift_off, 2 / radius_mm, skin_depth_mm=skin)
    assert abs(predicted - reads_like) * 1e3 < limit_um


def test_effective_radius_of_the_pencil_coil():
    skin = skin_depth_mm(19.0, 5e5)
    assert effective_radius_mm(PENCIL, [0.1, 0.3], skin) == pytest.approx([1.25, 1.37], rel=0.01)


def test_tight_surfaces_are_flagged():
    assert too_curved(PENCIL, [0.0, 1 / 16, -1 / 16, 1 / 14, -1 / 10]).tolist() == [False, False, False, True, True]
    assert curved_lift_off_mm(PENCIL, 0.05, -1.0) == 0.0


def test_loops_of_the_check_follow_maxwell():
    r1, r2, d = 1e-3, 1.3e-3, 0.5e-3
    m = 4 * r1 * r2 / ((r1 + r2) ** 2 + d**2)
    exact = MU0 * np.sqrt(r1 * r2 / m) * ((2 - m) * ellipk(m) - 2 * ellipe(m))
    z = np.array([0.0, 0.0, 1.0])
    assert loop_mutual_h((r1, 0 * z, z), (r2, d * z, z), 64) == pytest.approx(exact, rel=1e-8)
