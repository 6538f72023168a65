import numpy as np
import pytest
from scipy.special import j0, j1, struve

from eddyscan.physics import Coil, Conductor, Layer, air_inductance_h, impedance_change_ohm, impedance_ohm
from eddyscan.physics.coil import winding_integral

TEAM15 = Coil(6.15, 12.4, 6.15, 3790)
PENCIL = Coil(0.5, 1.5, 1.0, 100)


def test_winding_integral_equals_the_struve_form():
    q = np.array([10.0, 300.0, 4000.0, 20000.0])
    edge = [np.pi * x / 2 * (j1(x) * struve(0, x) - j0(x) * struve(1, x)) for x in (q * 12.4e-3, q * 6.15e-3)]
    expected = (edge[0] - edge[1]) / q**2
    assert np.allclose(winding_integral(TEAM15, q), expected, rtol=1e-9, atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize(
    ("coil", "henry", "tolerance"),
    [
        (TEAM15, 225.99e-3, 5e-5),  # independent finite elements give 225.9 mH
        (Coil(9.34, 18.4, 9.0, 408), 3.985e-3, 1e-4),
        (PENCIL, 12.67e-6, 5e-4),
    ],
)
def test_inductance_in_air(coil, henry, tolerance):
    assert air_inductance_h(coil) == pytest.approx(henry, rel=tolerance)


def test_team15_coil_over_the_sound_plate():
    z = complex(impedance_ohm(TEAM15, Conductor.plate(30.6, 12.22), 900.0, 0.88))
    assert z.imag / (2 * np.pi * 900) == pytest.approx(178.656e-3, rel=5e-4)
    assert z.real == pytest.approx(120.651, rel=5e-4)


def test_splitting_a_layer_changes_nothing():
    whole = impedance_change_ohm(PENCIL, Conductor.half_space(19.0), 5e5, 0.1)
    split = Conductor((Layer(19.0, 0.05), Layer(19.0, 0.2), Layer(19.0)))
    assert abs(impedance_change_ohm(PENCIL, split, 5e5, 0.1) / whole - 1) < 1e-12


def test_a_coating_is_lift_off():
    coated = Conductor((Layer(0.0, 0.15), Layer(19.0)))
    a = impedance_change_ohm(PENCIL, coated, 5e5, 0.1)
    b = impedance_change_ohm(PENCIL, Conductor.half_space(19.0), 5e5, 0.25)
    assert abs(a / b - 1) < 1e-12


def test_similitude():
    big = Coil(1.0, 3.0, 2.0, 100)
    x0 = [air_inductance_h(PENCIL) * 5e5, air_inductance_h(big) * 1.25e5]
    a = impedance_change_ohm(PENCIL, Conductor.half_space(19.0), 5e5, 0.1) / x0[0]
    b = impedance_change_ohm(big, Conductor.half_space(19.0), 1.25e5, 0.2) / x0[1]
    assert abs(a / b - 1) < 1e-12
