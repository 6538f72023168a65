"""SR830 and SR860 drivers, real PyMeasure, against the simulated lock-ins on their wires."""

import pytest

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OVERLOAD
from eddyscan.core.technique import Drive
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.sr830 import SR830, SR860, LockInSettings
from eddyscan.devices.sim.lockin import LockInSimulator
from eddyscan.devices.sim.world_settings import WorldFaults
from tests.devices.fixed_coil import FixedCoil
from tests.devices.instrument_contract import DRIVE, InstrumentContract

DRIVERS = {"SR830": SR830, "SR860": SR860}


class Wire:
    def __init__(self, model, coil=None, faults=None, **settings):
        self.clock, self.coil = VirtualClock(), coil or FixedCoil()
        self.simulator = LockInSimulator(self.coil, self.clock, model=model, faults=faults)
        host, port = self.simulator.start()
        address = f"TCPIP::{host}::{port}::SOCKET"
        self.driver = None
        try:
            self.driver = DRIVERS[model](LockInSettings(address=address, **{"timeout_s": 8.0} | settings), self.clock)
        except BaseException:
            self.simulator.close()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.driver.close()
        self.simulator.close()


@pytest.fixture(params=["SR830", "SR860"])
def model(request):
    return request.param


class TestContract(InstrumentContract):
    @pytest.fixture
    def instrument(self, model):
        with Wire(model) as wire:
            yield wire.driver

    @pytest.fixture
    def true_ohm(self):
        return FixedCoil().true_ohm(DRIVE.frequency_hz)


def test_settled_reading_has_forgotten_where_the_coil_was(model):
    with Wire(model) as wire:
        wire.driver.configure(DRIVE)
        wire.driver.read()
        wire.coil.scale = 2.0
        true = wire.coil.true_ohm(DRIVE.frequency_hz)
        assert abs(wire.driver.read().impedance_ohm - true) < 1e-3 * abs(true)


def test_free_running_reading_lags_and_is_stamped_earlier(model):
    with Wire(model, timing="free", time_constant_s=0.1) as wire:
        wire.driver.configure(DRIVE)
        before = wire.driver.read()
        wire.coil.scale = 2.0
        after = wire.driver.read()
        assert abs(after.impedance_ohm - before.impedance_ohm) < 0.1 * abs(before.impedance_ohm)
        assert after.time_s == pytest.approx(wire.clock.now() - 0.001 - 0.2, abs=0.01)


def test_too_much_voltage_is_a_flag(model):
    with Wire(model, FixedCoil(scale=30.0)) as wire:
        wire.driver.configure(DRIVE)
        assert wire.driver.read().flag == OVERLOAD


def test_world_hears_the_impedance_that_the_driver_reports(model):
    with Wire(model) as wire:
        wire.driver.configure(DRIVE)
        z = wire.driver.read().impedance_ohm
        assert abs(wire.coil.sent_values[-1] - z) < 1e-9 * abs(z)


def test_step_the_instrument_lacks_names_the_nearest(model):
    with pytest.raises(TechniqueError, match=rf"= 0.002 is no step of the {model}; the nearest is 0.00"):
        Wire(model, time_constant_s=0.002)


def test_level_is_refused_not_clipped(model):
    with Wire(model) as wire, pytest.raises(TechniqueError, match=r"level_v = 15 is outside"):
        wire.driver.configure(Drive(frequency_hz=1e5, level_v=15.0))


def test_reading_before_configure_is_refused(model):
    with Wire(model) as wire, pytest.raises(DeviceError, match="no drive yet"):
        wire.driver.read()


def test_lost_link(model):
    with Wire(model, faults=WorldFaults(lcr_link_lost_after=1), timeout_s=1.0) as wire:
        wire.driver.configure(DRIVE)
        wire.driver.read()
        with pytest.raises(LinkError, match="failed to read"):
            wire.driver.read()


def test_the_other_model_at_the_address_is_refused():
    simulator = LockInSimulator(FixedCoil(), VirtualClock(), model="SR860")
    host, port = simulator.start()
    with pytest.raises(LinkError, match=r"SR860.*not an SR830"):
        SR830(LockInSettings(address=f"TCPIP::{host}::{port}::SOCKET"), VirtualClock())
    simulator.close()


def test_wire_of_the_sr830():
    lock_in = LockInSimulator(FixedCoil(), VirtualClock())
    for line in ("FREQ1.00000e+05", "SLVL1.000", "SENS22", "OFLT4", "OFSL1"):
        assert lock_in.answer(line) is None
    assert lock_in.answer("FREQ?") == "100000"
    assert lock_in.answer("SENS?") == "22"
    assert lock_in.answer("OFLT?") == "4"
    x, y = (float(word) for word in lock_in.answer("SNAP? 1,2").split(","))
    z = FixedCoil().true_ohm(1e5)
    assert complex(x, y) == pytest.approx(z / (z + 1050.0), rel=1e-3)
    assert lock_in.answer("LIAS?") == "0"
