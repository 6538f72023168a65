"""What the simulated E4980A answers, byte by byte."""

import pytest

from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.sim.lcr import IDENTITY, LcrSimulator
from tests.devices.fixed_coil import INDUCTANCE_H, RESISTANCE_OHM, FixedCoil


@pytest.fixture
def coil():
    return FixedCoil()


@pytest.fixture
def meter(coil):
    return LcrSimulator(coil, VirtualClock())


def test_identity(meter):
    assert meter.answer("*IDN?") == IDENTITY


@pytest.mark.parametrize("header", ["FREQ", ":FREQ:CW", "FREQuency", ":FREQUENCY:CW"])
def test_long_short_and_default_nodes_are_one_header(meter, header):
    assert meter.answer(f"{header} 2e5") is None
    assert meter.answer(f"{header}?") == "+2.00000E+05"


def test_triggered_reading_has_two_parts_six_digits_and_a_status(meter):
    for line in ("FUNC:IMP:TYPE RX", "FREQ 1e5", "APER SHORT,1", "TRIG:SOUR BUS"):
        assert meter.answer(line) is None
    first, second, status = meter.answer("*TRG").split(",")
    assert float(first) == pytest.approx(RESISTANCE_OHM, rel=1e-3)
    assert float(second) == pytest.approx(FixedCoil().true_ohm(1e5).imag, rel=1e-4)
    assert len(first) == len("+1.23456E+00")
    assert status == "+0"


def test_bus_trigger_keeps_its_reading_until_the_next(meter):
    for line in ("FUNC:IMP:TYPE RX", "FREQ 1e5", "TRIG:SOUR BUS", "TRIG:IMM"):
        meter.answer(line)
    assert meter.answer("FETC?") == meter.answer(":FETCH:IMPEDANCE:FORMATTED?".replace(":FORMATTED", ""))
    kept = meter.answer("FETC?")
    meter.answer("TRIG")
    assert meter.answer("FETC?") != kept


@pytest.mark.parametrize(
    ("mode", "first"),
    [("RX", RESISTANCE_OHM), ("LSRS", INDUCTANCE_H), ("ZTD", abs(FixedCoil().true_ohm(1e5)))],
)
def test_modes_show_the_same_impedance(meter, mode, first):
    meter.answer(f"FUNC:IMP:TYPE {mode}")
    meter.answer("FREQ 1e5")
    assert float(meter.answer("FETC?").split(",")[0]) == pytest.approx(first, rel=1e-3)


@pytest.mark.parametrize("line", ["FREQ 1", "FREQ 3e6", "VOLT 21", "APER SOON,1", "FUNC:IMP:TYPE XY", "FREQ fast"])
def test_value_out_of_range_is_an_error_in_the_queue_and_changes_nothing(meter, line):
    before = meter.answer("FREQ?"), meter.answer("VOLT?"), meter.answer("APER?")
    assert meter.answer(line) is None
    assert meter.answer("SYST:ERR?").startswith("-224")
    assert meter.answer("SYST:ERR?") == '+0,"No error"'
    assert (meter.answer("FREQ?"), meter.answer("VOLT?"), meter.answer("APER?")) == before


def test_unknown_header_is_an_error_in_the_queue(meter):
    meter.answer("MAKE:TEA")
    assert meter.answer("SYST:ERR?").startswith("-113")


def test_several_commands_in_one_line(meter):
    assert meter.answer("FREQ 1e5;FREQ?;VOLT?") == "+1.00000E+05;+1.00000E+00"


def test_world_is_told_exactly_what_the_wire_carried(meter, coil):
    for line in ("FUNC:IMP:TYPE RX", "FREQ 1e5", "TRIG:SOUR BUS"):
        meter.answer(line)
    first, second, _ = meter.answer("*TRG").split(",")
    assert coil.sent_values == [complex(float(first), float(second))]


@pytest.mark.parametrize(("aperture", "seconds"), [("SHORT,1", 0.0066), ("MED,1", 0.089), ("LONG,2", 0.441)])
def test_aperture_takes_its_time(coil, aperture, seconds):
    clock = VirtualClock()
    meter = LcrSimulator(coil, clock)
    meter.answer(f"APER {aperture}")
    before = clock.now()
    meter.answer("*TRG")
    assert clock.now() - before == pytest.approx(seconds, rel=1e-3)
