import numpy as np
import pytest
from scipy.special import ellipe, ellipk, eval_legendre, spherical_jn

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


def loop_mutual_h(radius_a, centre_a, axis_a, radius_b, centre_b, axis_b, points):
    """Neumann's double integral over two circles, trapezoidal in both angles."""

    def circle(radius, centre, axis):
        axis = axis / np.linalg.norm(axis)
        one = np.cross(axis, [0.0, 1.0, 0.0])
        one /= np.linalg.norm(one)
        two = np.cross(axis, one)
        angle = 2 * np.pi * np.arange(points) / points
        place = centre + radius * (np.cos(angle)[:, None] * one + np.sin(angle)[:, None] * two)
        step = radius * 2 * np.pi / points * (-np.sin(angle)[:, None] * one + np.cos(angle)[:, None] * two)
        return place, step

    place_a, step_a = circle(radius_a, centre_a, axis_a)
    place_b, step_b = circle(radius_b, centre_b, axis_b)
    distance = np.linalg.norm(place_a[:, None] - place_b[None], axis=2)
    return MU0 / (4 * np.pi) * np.sum((step_a @ step_b.T) / distance)


def neumann_change_h(coil, lift_off_mm, tilt_deg, cells):
    """Mutual inductance of a coil and its image in a perfect conductor, the winding cut into loops."""
    sine, cosine = np.sin(np.radians(tilt_deg)), np.cos(np.radians(tilt_deg))
    nodes, weights = np.polynomial.legendre.leggauss(cells)
    radii = 1e-3 * (0.5 * (coil.outer_radius_mm - coil.inner_radius_mm) * (nodes + 1) + coil.inner_radius_mm)
    heights = 1e-3 * 0.5 * coil.length_mm * (nodes + 1)
    axis = np.array([sine, 0.0, cosine])
    mirror = np.array([1.0, 1.0, -1.0])
    total = 0.0
    for r1, w1 in zip(radii, weights, strict=True):
        for z1, v1 in zip(heights, weights, strict=True):
            one = np.array([0.0, 0.0, 1e-3 * lift_off_mm]) + z1 * axis
            for r2, w2 in zip(radii, weights, strict=True):
                for z2, v2 in zip(heights, weights, strict=True):
                    other = (np.array([0.0, 0.0, 1e-3 * lift_off_mm]) + z2 * axis) * mirror
                    # an image circuit carries the mirrored current: its axis flips in x and y, not in z
                    m = loop_mutual_h(r1, one, axis, r2, other, axis * [-1.0, -1.0, 1.0], 48)
                    total -= w1 * v1 * w2 * v2 / 16 * m
    return coil.turns**2 * total


@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 30.0])
def test_tilted_coil_equals_neumanns_integral_over_a_perfect_conductor(tilt_deg):
    coil = Coil(1.0, 1.5, 0.6, 1)
    perfect = Conductor.half_space(60.0)
    frequency = 1e15  # a skin depth of nothing, inside the coil's own formulas
    lift_off = least_lift_off_mm(coil, tilt_deg) + 0.5
    change = complex(impedance_change_ohm(coil, perfect, frequency, lift_off, tilt_deg))
    expected = neumann_change_h(coil, lift_off, tilt_deg, 3)
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


def sphere_change_ohm(coil, radius_mm, lift_off_mm, frequency, sigma, cells=8, terms=400):
    """Exact axisymmetric coil over a conducting sphere: A of loops in Legendre functions, winding cut into loops.

    Smythe, Static and Dynamic Electricity, 3rd ed., 10.06 (sphere in an alternating axial field).
    """
    nodes, weights = np.polynomial.legendre.leggauss(cells)
    a = 1e-3 * radius_mm
    radii = 1e-3 * (0.5 * (coil.outer_radius_mm - coil.inner_radius_mm) * (nodes + 1) + coil.inner_radius_mm)
    heights = a + 1e-3 * (lift_off_mm + 0.5 * coil.length_mm * (nodes + 1))
    rho, z = (g.ravel() for g in np.meshgrid(radii, heights))
    weight = np.outer(weights, weights).ravel() / 4 * coil.turns
    r, cosine = np.hypot(rho, z), z / np.hypot(rho, z)
    sine = rho / r
    n = np.arange(1, terms + 1)[:, None]
    slope = n * (eval_legendre(n - 1, cosine) - cosine * eval_legendre(n, cosine)) / sine  # -P_n^1
    x = np.sqrt(-2j * np.pi * frequency * MU0 * sigma) * a
    ratio = np.empty(terms, dtype=complex)
    for order in range(1, terms + 1):
        # j_(n+1)/j_n by Lentz's continued fraction, safe for large arguments
        ratio[order - 1] = _bessel_ratio(order, x)
    reflected = x * ratio / ((2 * n[:, 0] + 1) - x * ratio)
    moment = (slope * sine * r * (a / r) ** (n + 1)) @ weight
    share = np.pi * MU0 / (n[:, 0] * (n[:, 0] + 1)) * reflected / a
    return 2j * np.pi * frequency * np.sum(share * moment**2)


def _bessel_ratio(order, x):
    value = 0j
    for step in range(order + int(abs(x)) + 60, order, -1):
        value = 1.0 / ((2 * step + 1) / x - value)
    return value


def test_bessel_ratio_of_the_check():
    x = 3.0 - 2.0j
    assert _bessel_ratio(4, x) == pytest.approx(spherical_jn(5, x) / spherical_jn(4, x))


@pytest.mark.parametrize(("radius_mm", "limit_um"), [(50.0, 1.0), (25.0, 2.0), (15.0, 4.0)])
def test_curvature_as_lift_off_against_the_exact_sphere(radius_mm, limit_um):
    skin = skin_depth_mm(19.0, 5e5)
    lift_off = 0.3
    sphere = sphere_change_ohm(PENCIL, radius_mm, lift_off, 5e5, 19e6, terms=int(24 * radius_mm))
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
    assert loop_mutual_h(r1, 0 * z, z, r2, d * z, z, 64) == pytest.approx(exact, rel=1e-8)
