"""The E4980A driver, real PyMeasure and pyvisa-py, against the simulated meter on its wire."""

import socket

import pytest

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OK, OVERLOAD
from eddyscan.core.technique import Drive
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.keysight_e4980a import KeysightE4980A, KeysightE4980ASettings
from eddyscan.devices.sim.instrument_wire import InstrumentServer
from eddyscan.devices.sim.lcr import IDENTITY, LcrSimulator
from eddyscan.devices.sim.world_settings import WorldFaults
from tests.devices.fixed_coil import FixedCoil
from tests.devices.instrument_contract import DRIVE, InstrumentContract


def meter_on_wire(coil=None, **options):
    clock = VirtualClock()
    simulator = LcrSimulator(coil or FixedCoil(), clock, **options)
    host, port = simulator.start()
    return simulator, clock, f"TCPIP::{host}::{port}::SOCKET"


def driver_for(address, clock, **settings):
    return KeysightE4980A(KeysightE4980ASettings(address=address, **{"timeout_s": 8.0} | settings), clock)


@pytest.fixture
def meter():
    simulator, clock, address = meter_on_wire()
    driver = driver_for(address, clock)
    yield driver
    driver.close()
    simulator.close()


class TestContract(InstrumentContract):
    @pytest.fixture
    def instrument(self, meter):
        return meter

    @pytest.fixture
    def true_ohm(self):
        return FixedCoil().true_ohm(DRIVE.frequency_hz)


def test_identity_comes_from_the_meter(meter):
    identity = meter.identity()
    assert identity.serial == "VIRTUAL0001"
    assert identity.firmware == "A.07.00"
    assert not identity.verified


def test_reading_takes_the_aperture_and_is_stamped_with_its_middle():
    simulator, clock, address = meter_on_wire(short_s=0.01, latency_s=0.0)
    driver = driver_for(address, clock, averages=4)
    driver.configure(DRIVE)
    before = clock.now()
    reading = driver.read()
    assert clock.now() - before == pytest.approx(0.04)
    assert reading.time_s == pytest.approx(before + 0.02)
    driver.close()
    simulator.close()


def test_overload_is_a_flag_and_the_value_stays_as_sent():
    simulator, clock, address = meter_on_wire(FixedCoil(scale=1e6))
    driver = driver_for(address, clock)
    driver.configure(DRIVE)
    reading = driver.read()
    assert reading.flag == OVERLOAD
    assert reading.impedance_ohm.real == pytest.approx(9.9e37)
    driver.close()
    simulator.close()


def test_every_so_many_readings_overload_when_the_world_says_so():
    simulator, clock, address = meter_on_wire(faults=WorldFaults(lcr_overload_every=3))
    driver = driver_for(address, clock)
    driver.configure(DRIVE)
    assert [driver.read().flag for _ in range(6)] == [OK, OK, OVERLOAD] * 2
    driver.close()
    simulator.close()


def test_lost_link_names_the_address_and_the_way_out():
    simulator, clock, address = meter_on_wire(faults=WorldFaults(lcr_link_lost_after=2))
    driver = driver_for(address, clock, timeout_s=1.0)
    driver.configure(DRIVE)
    driver.read()
    driver.read()
    with pytest.raises(LinkError, match=rf"{address} failed to read: .*Check the cable"):
        driver.read()
    driver.close()
    simulator.close()


def test_silent_meter_is_given_up_after_its_timeout():
    simulator, clock, address = meter_on_wire(faults=WorldFaults(lcr_silent_after=1))
    driver = driver_for(address, clock, timeout_s=1.0)
    driver.configure(DRIVE)
    driver.read()
    with pytest.raises(LinkError, match="failed to read"):
        driver.read()
    driver.close()
    simulator.close()


def test_nobody_at_the_address():
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with pytest.raises(LinkError, match=rf"TCPIP::127.0.0.1::{port}::SOCKET failed to connect: .*refused.*rig.toml"):
        driver_for(f"TCPIP::127.0.0.1::{port}::SOCKET", VirtualClock())


def test_another_instrument_at_the_address_is_refused():
    server = InstrumentServer(lambda line: "ACME,Toaster,1,1" if line == "*IDN?" else None)
    host, port = server.start()
    with pytest.raises(LinkError, match=r"Toaster.*not an E4980A"):
        driver_for(f"TCPIP::{host}::{port}::SOCKET", VirtualClock())
    server.close()


def test_garbled_answer_is_no_reading():
    garbled = {"*IDN?": IDENTITY, "SYST:ERR?": '+0,"No error"', ":FREQ:CW?": "+1.00000E+05", "*TRG": "+1.2E+0x,?"}
    server = InstrumentServer(garbled.get)
    host, port = server.start()
    driver = driver_for(f"TCPIP::{host}::{port}::SOCKET", VirtualClock())
    driver.configure(DRIVE)
    with pytest.raises(LinkError, match=r"answered .* where 3 numbers were due"):
        driver.read()
    driver.close()
    server.close()


def test_meter_that_keeps_another_frequency_is_an_error():
    stubborn = {"*IDN?": IDENTITY, "SYST:ERR?": '+0,"No error"', ":FREQ:CW?": "+1.00000E+03"}
    server = InstrumentServer(stubborn.get)
    host, port = server.start()
    driver = driver_for(f"TCPIP::{host}::{port}::SOCKET", VirtualClock())
    with pytest.raises(DeviceError, match=r"keeps 1000 Hz, asked for was 100000 Hz"):
        driver.configure(DRIVE)
    driver.close()
    server.close()


def test_level_above_the_meter_is_refused(meter):
    with pytest.raises(TechniqueError, match=r"frequency_hz = 10 is outside the E4980A's 20 to 2e\+06 Hz"):
        meter.configure(Drive(frequency_hz=10.0, level_v=1.0))
