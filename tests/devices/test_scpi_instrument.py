"""The generic instrument: a meter described by lines of TOML, against the simulated E4980A."""

import tomllib
from pathlib import Path

import pytest
from pydantic import ValidationError

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OVERLOAD
from eddyscan.core.technique import Drive
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.scpi import ScpiInstrument, ScpiSettings
from eddyscan.devices.rig import RigSettings, connect
from eddyscan.devices.sim.lcr import LcrSimulator
from tests.devices.fixed_coil import FixedCoil
from tests.devices.instrument_contract import DRIVE, InstrumentContract

LINES = """
expect = "E4980A"
setup = ["FUNC:IMP RX", "APER SHORT,1", "TRIG:SOUR BUS"]
frequency = "FREQ {frequency_hz:g}"
frequency_query = "FREQ?"
level = "VOLT {level_v:g}"
error_query = "SYST:ERR?"
read = "*TRG"
form = "ohm"
status_index = 2
overload_status = [1]
range_hz = [20, 2e6]
timeout_s = 8.0
"""


@pytest.fixture
def meter():
    simulator = LcrSimulator(FixedCoil(), VirtualClock())
    host, port = simulator.start()
    simulator.address = f"TCPIP::{host}::{port}::SOCKET"
    yield simulator
    simulator.close()


def instrument_with(meter, **changes):
    settings = ScpiSettings.model_validate(tomllib.loads(LINES) | {"address": meter.address} | changes)
    return ScpiInstrument(settings, VirtualClock())


class TestContract(InstrumentContract):
    @pytest.fixture
    def instrument(self, meter):
        device = instrument_with(meter)
        yield device
        device.close()

    @pytest.fixture
    def true_ohm(self):
        return FixedCoil().true_ohm(DRIVE.frequency_hz)


@pytest.mark.parametrize(("form", "mode"), [("ohm-deg", "ZTD"), ("ohm-rad", "ZTR"), ("henry-ohm", "LSRS")])
def test_other_forms_give_the_same_impedance(meter, form, mode):
    device = instrument_with(meter, form=form, setup=[f"FUNC:IMP {mode}", "TRIG:SOUR BUS"])
    device.configure(DRIVE)
    true = FixedCoil().true_ohm(DRIVE.frequency_hz)
    assert abs(device.read().impedance_ohm - true) < 1e-3 * abs(true)
    device.close()


def test_rig_names_it_like_any_other_driver(meter):
    device = connect(
        "instrument",
        "eddyscan.devices.drivers.scpi:ScpiInstrument",
        meter.address,
        tomllib.loads(LINES),
        clock=VirtualClock(),
    )
    assert device.identity().model == "Keysight Technologies E4980A"
    device.close()


def test_status_becomes_a_flag(meter):
    meter._coil.scale = 1e6
    device = instrument_with(meter)
    device.configure(DRIVE)
    assert device.read().flag == OVERLOAD
    device.close()


def test_what_the_instrument_refuses_is_an_error(meter):
    device = instrument_with(meter, frequency="FREQ {frequency_hz:g} kettles")
    with pytest.raises(DeviceError, match=r"refuses to be configured: -224"):
        device.configure(DRIVE)
    device.close()


def test_unexpected_identity(meter):
    with pytest.raises(LinkError, match=r"expected was 'SR830'"):
        instrument_with(meter, expect="SR830")


def test_frequency_outside_range_names_key_value_and_range(meter):
    device = instrument_with(meter)
    with pytest.raises(TechniqueError, match=r"frequency_hz = 10 is outside .* 20 to 2e\+06 Hz \(range_hz"):
        device.configure(Drive(frequency_hz=10.0, level_v=1.0))
    device.close()


def test_answer_with_too_few_numbers(meter):
    device = instrument_with(meter, read="FREQ?")
    device.configure(DRIVE)
    with pytest.raises(LinkError, match="where 3 numbers were due"):
        device.read()
    device.close()


def test_free_running_reading_is_stamped_by_its_age(meter):
    device = instrument_with(meter, timing="free", delay_s=0.5)
    device.configure(DRIVE)
    assert device.read().time_s == pytest.approx(-0.5)
    device.close()


def test_line_that_cannot_be_filled_is_refused_when_the_rig_is_read():
    with pytest.raises(ValidationError, match="cannot be filled with frequency_hz and level_v"):
        ScpiSettings(frequency="FREQ {hertz}")


def test_the_how_to_page_describes_a_meter_that_works(meter):
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "add-an-instrument.md").read_text(encoding="utf-8")
    table = next(block for block in page.split("```toml") if "[instrument.options]" in block).split("```")[0]
    rig = RigSettings.model_validate(tomllib.loads(table))
    device = connect("instrument", rig.instrument.driver, meter.address, rig.instrument.options, clock=VirtualClock())
    device.configure(DRIVE)
    true = FixedCoil().true_ohm(DRIVE.frequency_hz)
    assert abs(device.read().impedance_ohm - true) < 1e-3 * abs(true)
    device.close()
