import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from eddyscan.core.errors import TechniqueError
from eddyscan.physics import Coil, Conductor, Layer, Slot, SlotSolver, impedance_ohm
from eddyscan.physics.coil import MU0
from eddyscan.physics.field import field_v_m
from eddyscan.physics.probes import (
    CoilPair,
    differential_change_ohm,
    mutual_impedance_ohm,
    transmit_receive_change_ohm,
)
from eddyscan.physics.quadrature import gauss_panels

PENCIL = Coil(0.5, 1.5, 1.0, 100)
OTHER = Coil(0.4, 0.9, 0.7, 60)
ALUMINIUM = Conductor.half_space(19.0)
CRACK = Slot(3.0, 1.0, 0.02)


@pytest.fixture(scope="module")
def solver():
    return SlotSolver(CRACK, ALUMINIUM, 5e5, detail_mm=0.65)


def loops_potential(coil, r_m, z_m, lift_off_mm):
    """A_phi per ampere of the coil as loops, by elliptic integrals (Jackson, 5.37)."""
    x, w = np.polynomial.legendre.leggauss(14)
    radius = 1e-3 * (coil.inner_radius_mm + 0.5 * (coil.outer_radius_mm - coil.inner_radius_mm) * (x + 1))
    height = 1e-3 * (lift_off_mm + 0.5 * coil.length_mm * (x + 1))
    a, h = np.meshgrid(radius, height)
    m = 4 * a * r_m / ((a + r_m) ** 2 + (h - z_m) ** 2)
    loops = MU0 / (np.pi * np.sqrt(m)) * np.sqrt(a / r_m) * ((1 - m / 2) * ellipk(m) - ellipe(m))
    return coil.turns * np.sum(np.outer(w, w) / 4 * loops)


@pytest.mark.parametrize(("r_mm", "z_mm"), [(0.3, -0.2), (1.2, -0.5), (3.0, -1.0)])
def test_field_in_a_poor_conductor_is_that_of_the_coil_in_air(r_mm, z_mm):
    poor = Conductor.half_space(1e-9)
    found = complex(field_v_m(PENCIL, poor, 1e4, r_mm=r_mm, z_mm=z_mm, lift_off_mm=0.3))
    expected = -2j * np.pi * 1e4 * loops_potential(PENCIL, 1e-3 * r_mm, 1e-3 * z_mm, 0.3)
    assert found == pytest.approx(expected, rel=1e-6)


def test_power_in_the_metal_is_the_coils_resistance():
    """Poynting: Re Z I^2 = integral of sigma |E|^2 dV."""
    r, wr = gauss_panels(np.array([0.0, 0.5, 1, 1.5, 2, 3, 5, 8, 14, 30]), 10)
    z, wz = gauss_panels(-np.array([2.0, 1.2, 0.6, 0.3, 0.12, 0.04, 0.0]), 8)
    field = field_v_m(PENCIL, ALUMINIUM, 5e5, r_mm=r[:, None], z_mm=z, lift_off_mm=0.2)
    power = 19e6 * np.sum(2 * np.pi * (r * wr)[:, None] * wz * np.abs(field) ** 2) * 1e-9
    assert power == pytest.approx(float(impedance_ohm(PENCIL, ALUMINIUM, 5e5, 0.2).real), rel=1e-4)


def test_field_goes_on_into_the_same_metal_below():
    layered = Conductor((Layer(19.0, 0.5), Layer(19.0)))
    one = field_v_m(PENCIL, layered, 5e5, r_mm=[0.5, 1.0], z_mm=-0.3, lift_off_mm=0.2)
    assert np.allclose(one, field_v_m(PENCIL, ALUMINIUM, 5e5, r_mm=[0.5, 1.0], z_mm=-0.3, lift_off_mm=0.2))


def test_field_outside_the_layer_is_refused():
    with pytest.raises(TechniqueError, match=r"z_mm = -0\.6: must lie from -0\.5 to 0 mm"):
        field_v_m(PENCIL, Conductor.plate(19.0, 0.5), 5e5, r_mm=1.0, z_mm=-0.6, lift_off_mm=0.1)


@pytest.mark.parametrize("profile", ["rectangular", "semi-elliptic"])
def test_the_field_folded_onto_the_slot_equals_plain_quadrature(profile):
    slot = Slot(3.0, 1.0, 0.04, profile)
    shaped = SlotSolver(slot, ALUMINIUM, 2e5, detail_mm=1.0, functions=(4, 3))
    x0, y0, h = 0.7, 0.9, 0.25
    on_slot = shaped.coil(PENCIL, reach_mm=2.5, lift_off_mm=np.array([h]))
    ((_, drive),) = on_slot.drives(np.array([1e-3 * x0]), np.array([1e-3 * y0]))
    theta, wt = gauss_panels(np.linspace(0, np.pi, 9), 8)
    beta, wb = gauss_panels(np.linspace(0, np.pi / 2, 5), 8)
    x = 1.5 * np.cos(theta)[:, None]
    depth = np.sin(theta)[:, None] if profile == "semi-elliptic" else np.ones((len(theta), 1))
    z = -depth * np.sin(beta)
    area = 1.5 * np.sin(theta)[:, None] * wt[:, None] * depth * np.cos(beta) * wb * 1e-6
    r = np.broadcast_to(np.hypot(x - x0, y0), z.shape)
    field = field_v_m(PENCIL, ALUMINIUM, 2e5, r_mm=r, z_mm=z, lift_off_mm=h)
    born = 19e6 * 0.04e-3 * np.sum(area * (field * y0 / r) ** 2)
    assert np.sum(drive.along**2) == pytest.approx(born, rel=1e-3)
    xi, zeta = x / 1.5, z
    if profile == "semi-elliptic":
        first = shaped.basis.functions(np.broadcast_to(xi, z.shape), zeta)[0]
    else:
        first = np.sqrt(1 - xi**2) * np.sqrt(1 - zeta**2)
    across = np.sum(area * first * field * (x - x0) / r)
    assert drive.across[0, 0, 0] == pytest.approx(across, rel=1e-4)


def test_far_away_the_slot_is_not_seen_and_costs_no_more(solver):
    near, far, farther = np.abs(solver.change_ohm(PENCIL, [1.0, 8.0, 400.0], [0.0, 5.0, 300.0], 0.1))
    assert far < 1e-4 * near
    assert farther < 1e-9 * near
    alone = abs(solver.change_ohm(PENCIL, 8.0, 5.0, 0.1)[0])
    assert far == pytest.approx(alone, rel=1e-3)


def test_reciprocity_of_two_different_coils(solver):
    pair = CoilPair(PENCIL, OTHER, 2.6, 35.0)
    turned = CoilPair(OTHER, PENCIL, 2.6, 215.0)
    x, y = np.array([0.0, 0.8, -1.5]), np.array([0.0, 0.5, 1.0])
    one = transmit_receive_change_ohm(solver, pair, x_mm=x, y_mm=y, lift_off_mm=0.1)
    other = transmit_receive_change_ohm(solver, turned, x_mm=x, y_mm=y, lift_off_mm=0.1)
    assert np.allclose(one, other, rtol=1e-6, atol=1e-7 * np.abs(one).max())


def test_transfer_of_a_coil_to_itself_is_its_own_change(solver):
    own = solver.change_ohm(PENCIL, 0.8, 0.3, 0.1)
    moved = solver.transfer_ohm(PENCIL, PENCIL, (1e-9, 0.0), x_mm=0.8, y_mm=0.3, lift_off_mm=0.1)
    assert np.allclose(own, moved, rtol=1e-5)


def test_differential_probe_is_blind_in_the_middle_and_odd_about_it(solver):
    pair = CoilPair(PENCIL, PENCIL, 3.2)
    x = np.array([-1.3, 0.0, 1.3])
    change = differential_change_ohm(solver, pair, x_mm=x, y_mm=0.0, lift_off_mm=0.1)
    assert abs(change[1]) < 1e-6 * abs(change[0])
    assert change[0] == pytest.approx(-change[2], rel=1e-6)


def test_mutual_inductance_of_two_coils_side_by_side_in_air():
    """Two thin loops far apart: Neumann's integral."""
    one = Coil(0.99, 1.01, 0.02, 1)
    angle = 2 * np.pi * np.arange(200) / 200
    place = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    distance = np.linalg.norm(place + np.array([2.5, 0.0]) - place[:, None], axis=2)
    parallel = np.cos(angle[:, None] - angle)
    neumann = MU0 / (4 * np.pi) * 1e-3 * np.sum(parallel / distance) * (2 * np.pi / 200) ** 2
    air = Conductor((Layer(0.0, 1.0),))
    found = complex(mutual_impedance_ohm(CoilPair(one, one, 2.5), air, 1e5, 0.1))
    assert found.imag / (2 * np.pi * 1e5) == pytest.approx(neumann, rel=1e-3)
    assert found.real == pytest.approx(0.0, abs=1e-12)


def test_overlapping_windings_are_refused():
    with pytest.raises(TechniqueError, match=r"distance_mm = 2: must be at least 2\.4 mm"):
        CoilPair(PENCIL, OTHER, 2.0)
