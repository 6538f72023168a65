"""What holds for every coil, stack and frequency."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.physics import Coil, Conductor, Layer, air_inductance_h, impedance_change_ohm
from eddyscan.physics.coil import wave_numbers
from eddyscan.physics.conductor import reflection, skin_depth_mm
from eddyscan.physics.metal import SlottedMetal
from eddyscan.physics.slot_rectangle import RectangleBasis


@st.composite
def coils(draw):
    outer = draw(st.floats(0.5, 20.0))
    return Coil(outer * draw(st.floats(0.1, 0.9)), outer, outer * draw(st.floats(0.1, 3.0)), draw(st.integers(1, 5000)))


def layers(permeability):
    return st.builds(Layer, st.floats(0.0, 60.0), st.floats(0.05, 5.0), permeability)


def stacks(permeability):
    return st.lists(layers(permeability), min_size=1, max_size=3).map(lambda found: Conductor(tuple(found)))


frequencies = st.floats(2.0, 6.5).map(lambda exponent: 10.0**exponent)


@settings(max_examples=40, deadline=None)
@given(coils(), stacks(st.floats(1.0, 300.0)), frequencies)
def test_metal_takes_power_and_never_gives(coil, stack, frequency):
    change = complex(impedance_change_ohm(coil, stack, frequency, 0.1))
    assert change.real >= -1e-12 * 2 * np.pi * frequency * air_inductance_h(coil)


@settings(max_examples=40, deadline=None)
@given(coils(), stacks(st.just(1.0)), frequencies)
def test_non_magnetic_metal_lowers_the_reactance_and_less_so_further_away(coil, stack, frequency):
    h = coil.outer_radius_mm * np.array([0.0, 0.05, 0.3, 1.0, 3.0])
    change = impedance_change_ohm(coil, stack, frequency, h)
    x0 = 2 * np.pi * frequency * air_inductance_h(coil)
    assert np.all(change.imag <= 1e-12 * x0)
    assert np.all(np.diff(np.abs(change)) <= 1e-12 * x0)
    assert np.abs(change).max() < x0


@settings(max_examples=40, deadline=None)
@given(coils(), stacks(st.floats(1.0, 300.0)), frequencies)
def test_no_reflection_exceeds_one(coil, stack, frequency):
    k, _ = wave_numbers(coil)
    assert np.abs(reflection(stack, k, frequency)).max() <= 1 + 1e-12


@settings(max_examples=40, deadline=None)
@given(coils(), st.floats(1.0, 5.0))
def test_inductance_goes_with_size_and_turns_squared(coil, factor):
    big = Coil(factor * coil.inner_radius_mm, factor * coil.outer_radius_mm, factor * coil.length_mm, 2 * coil.turns)
    assert np.isclose(air_inductance_h(big), 4 * factor * air_inductance_h(coil), rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.5, 60.0), frequencies, st.floats(1.0, 100.0))
def test_skin_depth_goes_with_the_root(conductivity, frequency, factor):
    one, other = skin_depth_mm(conductivity, frequency), skin_depth_mm(conductivity, factor * frequency)
    assert np.isclose(one / other, np.sqrt(factor), rtol=1e-12)


@settings(max_examples=12, deadline=None)
@given(
    st.floats(0.2, 5.0),
    st.floats(0.1, 3.0),
    st.floats(3.0, 6.3).map(lambda exponent: 10.0**exponent),
    st.sampled_from([0.0, 0.01, 0.05]),
    st.sampled_from([None, 1.2, 4.0]),
)
def test_the_slots_matrix_dissipates(half_length, depth, frequency, opening, thickness_per_depth):
    """Dipoles that oppose the field take power from it: the real part of -A is negative definite, A symmetric."""
    thickness = None if thickness_per_depth is None else thickness_per_depth * depth
    metal = SlottedMetal(Layer(19.0, thickness), (), frequency, 1e-3 * opening)
    matrix = RectangleBasis(1e-3 * half_length, 1e-3 * depth, 5, 4).matrix(metal)
    assert np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(matrix.real).min() > 0
