import numpy as np
import pytest

from eddyscan.core.errors import TechniqueError
from eddyscan.physics import Coil, Conductor, air_inductance_h, impedance_change_ohm
from eddyscan.physics.coil_calibration import calibrate_coil

DRAWN = Coil(0.5, 1.5, 1.0, 100)
FREQUENCY = 500e3
NOISE = 2e-3


def readings(real, height, rng):
    air = 2j * np.pi * FREQUENCY * air_inductance_h(real) + 1.2
    noise = NOISE * (rng.standard_normal(len(height)) + 1j * rng.standard_normal(len(height)))
    return air + impedance_change_ohm(real, Conductor.half_space(19.0), FREQUENCY, height) + noise, air


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_an_approach_tells_the_height_of_the_metal(seed):
    rng = np.random.default_rng(seed)
    a, b, c = 1 + 0.02 * rng.uniform(-1, 1, 3)
    real = Coil(0.5 * a, 1.5 * b, 1.0 * c, 100)
    height = 0.5 + np.concatenate([np.arange(8) * 0.15, 1.4 + np.arange(3) * 0.5])
    heard, air = readings(real, height, rng)
    found = calibrate_coil(
        DRAWN, 19.0, FREQUENCY, height_mm=height + 7.3, impedance_ohm=heard, air_ohm=air, noise_ohm=NOISE
    )
    assert found.offset_mm == pytest.approx(7.3, abs=0.010)
    assert found.offset_sigma_mm < 0.010
    assert found.residual_ohm == pytest.approx(np.sqrt(2) * NOISE, rel=0.5)


def test_shims_fix_the_height():
    rng = np.random.default_rng(4)
    real = Coil(0.51, 1.48, 1.0, 100)
    height = np.array([0.1, 0.2, 0.4, 0.6, 1.0])
    heard, air = readings(real, height, rng)
    found = calibrate_coil(
        DRAWN, 19.0, FREQUENCY, height_mm=height, impedance_ohm=heard, air_ohm=air, noise_ohm=NOISE, absolute=True
    )
    assert found.offset_mm == pytest.approx(0.0, abs=1e-4)
    assert found.coil.outer_radius_mm == pytest.approx(1.48, rel=0.006)


def test_too_few_or_too_narrow_heights_are_refused():
    few = {"impedance_ohm": np.ones(3, dtype=complex), "air_ohm": 40j, "noise_ohm": NOISE}
    with pytest.raises(TechniqueError, match="at least 5 heights, 3 were given"):
        calibrate_coil(DRAWN, 19.0, FREQUENCY, height_mm=np.arange(3.0), **few)
    narrow = {**few, "impedance_ohm": np.ones(6, dtype=complex)}
    with pytest.raises(TechniqueError, match=r"span 0.25 mm, a coil of 1.5 mm .* at least 0.5 mm"):
        calibrate_coil(DRAWN, 19.0, FREQUENCY, height_mm=np.linspace(0, 0.25, 6), **narrow)
