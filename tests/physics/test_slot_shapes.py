"""The slot's Galerkin matrix against closed forms and brute force."""

import numpy as np
import pytest
from scipy.special import ellipe, gamma, jv, spherical_jn

from eddyscan.core.errors import TechniqueError
from eddyscan.physics import Coil, Conductor, Layer, Slot, SlotSolver
from eddyscan.physics.metal import SlottedMetal
from eddyscan.physics.quadrature import gauss_panels
from eddyscan.physics.slot_ellipse import EllipseBasis
from eddyscan.physics.slot_rectangle import RectangleBasis, depth_angles

PENCIL = Coil(0.5, 1.5, 1.0, 100)
ALUMINIUM = Conductor.half_space(19.0)
SIGMA = 19e6
STATIC = SlottedMetal(Layer(19.0), (), 1e-3, 0.0)


def static_dipole(basis, area_integrals, metal=STATIC):
    """Total dipole per unit field of a slot in a uniform static current."""
    return np.real(area_integrals @ np.linalg.solve(basis.matrix(metal), area_integrals))


@pytest.mark.parametrize("aspect", [1.0, 0.4, 3.0])
def test_half_ellipse_in_a_static_current_is_the_closed_form(aspect):
    """Potential jump 2 E d sqrt(1 - rho^2) / E(m) of an elliptic disc (Lamb, Hydrodynamics, art. 114)."""
    c, d = 1e-3, aspect * 1e-3
    basis = EllipseBasis(c, d, 6)
    integrals = basis._area_rule(60)[2].sum(axis=(1, 2))
    small, large = sorted((c, d))
    expected = SIGMA * 2 * small / ellipe(1 - (small / large) ** 2) * (2 * np.pi / 3 * c * d) / 2
    assert static_dipole(basis, integrals) == pytest.approx(expected, rel=2e-4)


def strip_share(length_per_depth, metal=STATIC):
    c, d = 0.5e-3 * length_per_depth, 1e-3
    basis = RectangleBasis(c, d, 16 + int(length_per_depth / 4), 10)
    theta, w = gauss_panels(np.linspace(0, np.pi, 60), 8)
    along = np.array([c * w @ (np.sin((m + 1) * theta) * np.sin(theta)) for m in range(basis.along)])
    theta, w = depth_angles(basis.down)
    down = np.array([d * w @ (np.sin((2 * n + 1) * theta) * np.sin(theta)) for n in range(basis.down)])
    expected = SIGMA * np.pi * d**2 / 2 * 2 * c
    return static_dipole(basis, np.outer(along, down).ravel(), metal) / expected


def test_long_strip_in_a_static_current_tends_to_theory():
    shares = [strip_share(ratio) for ratio in (10, 20, 40, 80)]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(0.988, abs=0.003)
    assert shares[0] == pytest.approx(0.898, abs=0.003)
    # what is missing shrinks as depth / length: the strip's theory is the limit
    assert (1 - shares[-1]) * 80 == pytest.approx((1 - shares[-2]) * 40, rel=0.1)


def test_long_strip_in_a_thin_plate_tends_to_the_periodic_array():
    """Images in both faces make a row of collinear cracks, dipole ln sec(pi d / 2t) (Koiter 1959)."""
    thickness = 1.0 / 0.7
    plate = SlottedMetal(Layer(19.0, thickness), (), 1e-3, 0.0)
    angle = np.pi / (2 * thickness)
    expected = -np.log(np.cos(angle)) / (0.5 * angle**2)
    shares = np.array([strip_share(ratio, plate) for ratio in (20, 40, 80)])
    assert shares[0] < shares[1] < shares[2] < expected
    first = 2 * shares[1:] - shares[:-1]  # current also flows round the ends: extrapolate in depth / length, twice
    assert 2 * first[1] - first[0] == pytest.approx(expected, rel=3e-3)


def test_transforms_of_the_rectangle_are_bessel_functions():
    theta, w = gauss_panels(np.linspace(0, np.pi, 20), 10)
    for m in range(6):
        numeric = w @ (np.sin((m + 1) * theta) * np.sin(theta) * np.exp(-1j * 3.3 * np.cos(theta)))
        assert numeric == pytest.approx(np.pi * (m + 1) * (-1j) ** m * jv(m + 1, 3.3) / 3.3)


def test_transforms_of_the_ellipse_are_spherical_bessel_functions():
    basis = EllipseBasis(1.0, 1.0, 7)
    x, z, weighted = basis._area_rule(80)
    q, alpha = 3.7, 0.6
    wave = np.exp(-1j * q * np.cos(alpha) * x)[:, None] * np.cos(q * np.sin(alpha) * z)
    numeric = 2 * np.sum(weighted * wave, axis=(1, 2))
    m, k = basis.orders
    strength = 2 / np.sqrt(np.pi) * gamma(k + 1.5) / gamma(k + 1)
    closed = 2 * np.pi * (-1j) ** m * np.cos(m * alpha) * strength * spherical_jn(m + 2 * k + 1, q) / q
    assert np.allclose(numeric, closed, atol=1e-8)


@pytest.mark.parametrize("thickness_mm", [None, 1.3])
def test_surface_terms_of_both_shapes_equal_a_plain_double_integral(thickness_mm):
    metal = SlottedMetal(Layer(19.0, thickness_mm), (), 1e5, 0.05e-3)
    c, d = 1.5e-3, 1.0e-3
    rectangle, ellipse = RectangleBasis(c, d, 1, 1), EllipseBasis(c, d, 0)
    u, wu = gauss_panels(np.concatenate([[0.0], 60.0 * 2.6 ** np.arange(7)]), 12)
    uu, vv, area = np.repeat(u, len(u)), np.tile(u, len(u)), np.outer(wu, wu).ravel()
    theta, wt = depth_angles(1)
    s = np.sin(theta)  # half width of the ellipse at z = -d cos(theta), in units of c
    line = np.pi * c * jv(1, uu * c) / (uu * c)
    lines = np.pi * c * s**3 * d * wt * jv(1, np.outer(uu * c, s)) / np.outer(uu * c, s)
    sums = np.zeros(2, dtype=complex)
    for weight, profile in zip(metal.weights(uu, vv), metal.profiles(np.hypot(uu, vv)), strict=True):
        sums[0] += np.sum(area * weight * (line * rectangle.depth_transform(profile)[:, 0]) ** 2)
        sums[1] += np.sum(area * weight * np.sum(lines * profile.values(-d * np.cos(theta)), axis=1) ** 2)
    assert rectangle.surface_matrix(metal)[0, 0] == pytest.approx(sums[0] / np.pi**2, rel=1e-4)
    assert ellipse.surface_matrix(metal)[0, 0] == pytest.approx(sums[1] / np.pi**2, rel=1e-4)


@pytest.mark.parametrize(("profile", "few", "many"), [("rectangular", (16, 12), (24, 18)), ("semi-elliptic", 20, 28)])
@pytest.mark.parametrize("opening_mm", [0.0, 0.04])
def test_more_functions_change_little(profile, few, many, opening_mm):
    slot = Slot(3.0, 1.0, opening_mm, profile)
    x, y = [1.0, 0.5, 0.0, 2.5], [0.0, 0.8, 1.2, 1.0]
    found = []
    for count in (few, many):
        functions = count if isinstance(count, tuple) else (count, count)
        solver = SlotSolver(slot, ALUMINIUM, 5e5, detail_mm=1.0, functions=functions)
        found.append(solver.change_ohm(PENCIL, x, y, 0.1))
    assert np.abs(found[1] - found[0]).max() < 2e-3 * np.abs(found[1]).max()


def test_slot_errors_name_key_value_and_range():
    with pytest.raises(TechniqueError, match=r"depth_mm = 0 mm: must be finite and greater than 0 mm"):
        Slot(3.0, 0.0)
    with pytest.raises(TechniqueError, match=r"opening_mm = 0\.6: must lie from 0 to 0\.5 mm"):
        Slot(3.0, 1.0, 0.6)
    with pytest.raises(TechniqueError, match=r"profile = 'round': must be one of rectangular, semi-elliptic"):
        Slot(3.0, 1.0, 0.1, "round")
    with pytest.raises(TechniqueError, match=r"depth_mm = 1: must be below the layer's thickness_mm = 0\.8"):
        SlotSolver(Slot(3.0, 1.0), Conductor.plate(19.0, 0.8), 5e5, detail_mm=1.0)
    with pytest.raises(TechniqueError, match=r"relative_permeability = 50 in layer 0: slots are modelled for 1 only"):
        SlotSolver(Slot(3.0, 1.0), Conductor.half_space(5.0, 50.0), 5e5, detail_mm=1.0)
    with pytest.raises(TechniqueError, match=r"length_mm = 200: must be at most 60\.8 mm for a coil of mean"):
        SlotSolver(Slot(200.0, 1.0), ALUMINIUM, 5e5, detail_mm=1.0)
    with pytest.raises(TechniqueError, match=r"conductivity_ms_m is 0 in every layer"):
        SlotSolver(Slot(3.0, 1.0), Conductor((Layer(0.0, 1.0),)), 5e5, detail_mm=1.0)


def test_a_layer_upon_its_own_metal_is_a_half_space():
    slot, x, y = Slot(3.0, 1.0, 0.03), [1.0, 0.4], [0.0, 1.0]
    layered = Conductor((Layer(19.0, 1.1), Layer(19.0, 0.3), Layer(19.0)))
    one, other = (
        SlotSolver(slot, metal, 5e4, detail_mm=1.0, functions=(10, 8)).change_ohm(PENCIL, x, y, 0.1)
        for metal in (ALUMINIUM, layered)
    )
    assert np.allclose(one, other, rtol=1e-6)


@pytest.mark.parametrize("profile", ["rectangular", "semi-elliptic"])
def test_a_thick_plate_is_a_half_space_and_a_thin_one_is_not(profile):
    slot, x, y = Slot(3.0, 1.0, 0.03, profile), [1.0, 0.4], [0.0, 1.0]
    deep, thick, thin = (
        SlotSolver(slot, metal, 1e5, detail_mm=1.0, functions=(10, 8)).change_ohm(PENCIL, x, y, 0.1)
        for metal in (ALUMINIUM, Conductor.plate(19.0, 6.0), Conductor.plate(19.0, 1.1))
    )
    assert np.allclose(thick, deep, rtol=1e-6)
    assert np.abs(thin / deep - 1).min() > 0.01


def test_a_coating_over_a_slot_is_lift_off():
    slot = Slot(3.0, 1.0, 0.03)
    painted = Conductor((Layer(0.0, 0.15), Layer(19.0)))
    one = SlotSolver(slot, painted, 5e5, detail_mm=1.0, functions=(8, 6)).change_ohm(PENCIL, 1.0, 0.5, 0.1)
    other = SlotSolver(slot, ALUMINIUM, 5e5, detail_mm=1.0, functions=(8, 6)).change_ohm(PENCIL, 1.0, 0.5, 0.25)
    assert np.allclose(one, other, rtol=1e-9)
