import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.errors import TechniqueError
from eddyscan.physics import Coil, Conductor, LiftOffCurve, skin_depth_mm
from eddyscan.physics.joint import JointModel

PENCIL = Coil(0.5, 1.5, 1.0, 100)
ALUMINIUM = Conductor.half_space(19.0)


CURVE = LiftOffCurve(PENCIL, ALUMINIUM, 5e5)


@pytest.fixture
def curve():
    return CURVE


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=20))
def test_lift_off_of_a_clean_reading_is_found(heights):
    found, sigma = CURVE.lift_off_mm(CURVE.impedance_ohm(heights))
    assert np.allclose(found, heights, atol=1e-9)
    assert np.all(sigma > 0)


@pytest.mark.parametrize(("height", "bound_um"), [(0.1, 1.08), (0.5, 3.27), (1.0, 10.2)])
def test_noisy_readings_reach_the_cramer_rao_bound(curve, height, bound_um):
    rng = np.random.default_rng(11)
    noise = 1e-3 * abs(curve.air_ohm)
    readings = curve.impedance_ohm(height) + noise / np.sqrt(2) * (rng.normal(size=20000) + 1j * rng.normal(size=20000))
    found, sigma = curve.lift_off_mm(readings, noise_ohm=noise)
    assert 1e3 * np.std(found) == pytest.approx(bound_um, rel=0.03)
    assert 1e3 * np.mean(sigma) == pytest.approx(bound_um, rel=0.03)
    assert abs(np.mean(found) - height) < 0.05 * np.std(found)


def test_a_reading_in_air_has_no_lift_off(curve):
    found, sigma = curve.lift_off_mm(np.array([curve.air_ohm, curve.impedance_ohm(0.2)]))
    assert np.isnan(found[0])
    assert np.isinf(sigma[0])
    assert found[1] == pytest.approx(0.2)


def test_outside_the_curve_names_value_and_limit(curve):
    with pytest.raises(TechniqueError, match=r"lift_off_mm = 4: this curve ends at 3 mm"):
        curve.impedance_ohm([0.1, 4.0])
    with pytest.raises(TechniqueError, match=r"lift_off_mm = -0\.1 at reading 1 of 2: must be finite and at least 0"):
        curve.impedance_ohm([0.1, -0.1])


def test_skin_depths_of_the_textbook():
    assert skin_depth_mm(58.0, 50.0) == pytest.approx(9.35, rel=2e-3)  # copper at mains frequency
    assert skin_depth_mm(19.0, 5e5) == pytest.approx(0.1633, rel=1e-3)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: Conductor.half_space(3.06e7), r"conductivity_ms_m = 3\.06e\+07.*looks like S/m.*is 30\.6 MS/m"),
        (lambda: Conductor.half_space(101.0), r"looks like % IACS: 101 % IACS is 58\.6 MS/m"),
        (lambda: Conductor.half_space(-1.0), r"must lie from 0 to 65 MS/m"),
        (lambda: Conductor.plate(19.0, 0.0), r"thickness_mm = 0 mm: must be finite and greater than 0 mm"),
        (lambda: Coil(1.5, 0.5, 1.0, 100), r"inner_radius_mm = 1\.5: must be below outer_radius_mm = 0\.5"),
        (lambda: Coil(0.5, 1.5, -1.0, 100), r"length_mm = -1 mm: must be finite and greater than 0"),
        (lambda: LiftOffCurve(PENCIL, ALUMINIUM, 0.0), r"frequency_hz = 0 Hz: must be finite and greater than 0"),
        (lambda: JointModel(PENCIL, 5e5, conductivity_range_ms_m=(20.0, 10.0)), r"\(20, 10\).*the range must rise"),
    ],
)
def test_bad_input_names_key_value_and_range(call, text):
    with pytest.raises(TechniqueError, match=text):
        call()


@pytest.fixture(scope="module")
def joint():
    return JointModel(PENCIL, [5e5], conductivity_range_ms_m=(10.0, 30.0))


def test_lift_off_with_conductivity_from_one_complex_reading(joint):
    truth = Conductor.half_space(17.3)
    clean = LiftOffCurve(PENCIL, truth, 5e5).impedance_ohm(0.1)
    rng = np.random.default_rng(2)
    noise = 1e-3 * abs(joint.air_ohm[0])
    readings = clean + noise / np.sqrt(2) * (rng.normal(size=4000) + 1j * rng.normal(size=4000))
    found = joint.estimate(readings, noise_ohm=noise)
    assert np.isfinite(found.lift_off_mm).all()
    assert np.mean(found.lift_off_mm) == pytest.approx(0.1, abs=2e-4)
    assert np.mean(found.conductivity_ms_m) == pytest.approx(17.3, rel=3e-3)
    assert np.std(found.lift_off_mm) == pytest.approx(np.mean(found.lift_off_sigma_mm), rel=0.06)
    assert np.std(found.conductivity_ms_m) == pytest.approx(np.mean(found.conductivity_sigma_ms_m), rel=0.06)
    assert 1e3 * np.mean(found.lift_off_sigma_mm) == pytest.approx(1.6, rel=0.1)
    assert np.mean(found.conductivity_sigma_ms_m / found.conductivity_ms_m) == pytest.approx(0.027, rel=0.1)


def test_a_second_frequency_narrows_both(joint):
    both = JointModel(PENCIL, [5e5, 1e6], conductivity_range_ms_m=(10.0, 30.0))
    truth = Conductor.half_space(17.3)
    pair = np.array([LiftOffCurve(PENCIL, truth, f).impedance_ohm(0.3) for f in (5e5, 1e6)])
    two = both.estimate(pair[None], noise_ohm=1e-3 * np.abs(both.air_ohm))
    one = joint.estimate(pair[:1], noise_ohm=1e-3 * np.abs(joint.air_ohm))
    assert two.lift_off_mm[0] == pytest.approx(0.3, abs=1e-5)
    assert two.conductivity_ms_m[0] == pytest.approx(17.3, rel=1e-4)
    assert two.lift_off_sigma_mm[0] < one.lift_off_sigma_mm[0]
    assert two.conductivity_sigma_ms_m[0] < one.conductivity_sigma_ms_m[0]


def test_conductivity_outside_the_range_is_not_invented(joint):
    copper = LiftOffCurve(PENCIL, Conductor.half_space(58.0), 5e5).impedance_ohm(0.1)
    found = joint.estimate(copper, noise_ohm=0.01)
    assert np.isnan(found.lift_off_mm[0])
    assert np.isnan(found.conductivity_ms_m[0])
