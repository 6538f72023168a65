"""What is said on the wire: the real library's bytes and the simulator's answers."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.sim.zaber import ZaberSimulator
from eddyscan.devices.sim.zaber_settings import GuessedFirmware, ZaberSettings
from eddyscan.devices.sim.zaber_wire import checksum, parse
from tests.devices.zaber_cell import zaber_cell


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def controller(clock):
    return ZaberSimulator(ZaberSettings(), clock)


def said(controller, line: str) -> list[str]:
    return [answer.decode().strip() for answer in controller.answer(line.encode())]


def home_all(controller, clock):
    said(controller, "/home")
    clock.sleep(30.0)
    said(controller, "/")


@pytest.mark.parametrize(
    ("body", "digits"),
    [("1 0 01 get comm.packet.size.max", "CF"), ("1 1 24 move abs 100000", "8A"), ("1 1 09", "F5"), ("0 0 00", "00")],
)
def test_checksums_equal_those_of_recorded_traffic(body, digits):
    assert checksum(body) == digits
    assert parse(f"/{body}:{digits}\n".encode()) is not None
    assert parse(f"/{body}x:{digits}\n".encode()) is None


def test_every_device_answers_a_broadcast(controller):
    assert said(controller, "/") == ["@01 0 OK IDLE WR 0", "@02 0 OK IDLE WR 0", "@03 0 OK IDLE WR 0"]


def test_message_ids_come_back(controller):
    assert said(controller, "/2 1 57 get resolution") == ["@02 1 57 OK IDLE WR 64"]


def test_homing_clears_the_missing_reference(controller, clock):
    assert said(controller, "/1 1 07 home") == ["@01 1 07 OK BUSY WR 0"]
    assert said(controller, "/1 1 08 warnings clear") == ["@01 1 08 OK BUSY WR 01 WR"]
    clock.sleep(10.0)
    assert said(controller, "/1 1 23") == ["@01 1 23 OK IDLE -- 0"]
    assert said(controller, "/1 1 24 get pos") == ["@01 1 24 OK IDLE -- 0"]


def test_an_absolute_move_without_reference_is_refused_unless_switched_off(clock):
    strict = ZaberSimulator(ZaberSettings(), clock)
    assert said(strict, "/1 1 move abs 5") == ["@01 1 RJ IDLE WR BADDATA"]
    lax = ZaberSimulator(ZaberSettings(guessed=GuessedFirmware(refuse_move_before_home=False)), clock)
    assert said(lax, "/1 1 move abs 5") == ["@01 1 OK BUSY WR 0"]


def test_a_target_beyond_the_limit_is_refused(controller, clock):
    home_all(controller, clock)
    assert said(controller, "/1 1 78 move abs 5249344") == ["@01 1 78 RJ IDLE -- BADDATA"]
    assert said(controller, "/1 1 78 move abs -1") == ["@01 1 78 RJ IDLE -- BADDATA"]


def test_a_stop_raises_ni_until_it_is_cleared(controller, clock):
    home_all(controller, clock)
    said(controller, "/1 1 move vel 68804")
    clock.sleep(0.1)
    assert said(controller, "/1 1 64 stop") == ["@01 1 64 OK BUSY NI 0"]
    assert said(controller, "/1 1 65 warnings clear") == ["@01 1 65 OK BUSY -- 01 NI"]
    clock.sleep(1.0)
    assert said(controller, "/1 1 66") == ["@01 1 66 OK IDLE -- 0"]


def test_a_move_takes_the_time_of_its_trapezoid(controller, clock):
    home_all(controller, clock)
    axis = controller.settings.axes[0]
    said(controller, "/1 1 move abs 2099738")
    ideal = 100.0 / axis.max_speed + axis.max_speed / axis.acceleration
    clock.sleep(ideal - 0.01)
    assert "BUSY" in said(controller, "/1 1")[0]
    clock.sleep(0.02)
    assert "IDLE" in said(controller, "/1 1")[0]


def test_a_driver_that_is_off_refuses(controller):
    assert said(controller, "/1 1 driver disable") == ["@01 1 OK IDLE FD 0"]
    assert said(controller, "/1 1 move rel 10") == ["@01 1 RJ IDLE FD DRIVERDISABLED"]
    assert said(controller, "/1 1 driver enable") == ["@01 1 OK IDLE WR 0"]


def test_firmware_6_knows_no_speed_in_a_move_nor_the_settings_of_7(clock):
    old = ZaberSimulator(ZaberSettings(firmware="6.28"), clock)
    home_all(old, clock)
    assert said(old, "/1 1 move abs 1000 5000") == ["@01 1 RJ IDLE -- BADDATA"]
    assert said(old, "/1 0 get get.settings.max") == ["@01 0 RJ IDLE -- BADCOMMAND"]
    assert said(old, "/1 0 get version") == ["@01 0 OK IDLE -- 6.28"]
    assert said(old, "/1 1 set maxspeed 172010") == ["@01 1 OK IDLE -- 0"]


def test_get_of_many_settings_is_rejected_not_mangled(controller):
    """The vendor's library aborts the whole process on a malformed answer to this one."""
    assert said(controller, "/1 0 get 1 maxspeed pos") == ["@01 0 RJ IDLE WR BADCOMMAND"]
    assert said(controller, "/1 0 get get.settings.max") == ["@01 0 RJ IDLE WR BADCOMMAND"]


def test_a_chain_has_no_timed_points_a_controller_has(clock):
    chain, mcc = ZaberSimulator(ZaberSettings(), clock), ZaberSimulator(ZaberSettings(layout="mcc"), clock)
    assert "BADCOMMAND" in said(chain, "/1 0 pvt 1 setup live 1")[0]
    assert said(mcc, "/1 0 pvt 1 setup live 1 2 3") == ["@01 0 OK IDLE WR 0"]


def test_an_alert_is_sent_when_an_axis_comes_to_rest():
    with zaber_cell(VirtualClock()) as cell:
        lines = []
        cell.simulator._peers[0].send = lambda data: lines.append(data)
        said(cell.simulator, "/0 0 set comm.alert 1")
        said(cell.simulator, "/1 1 move abs 1000")
        cell.clock.sleep(5.0)
        said(cell.simulator, "/1 1")
        assert b"!01 1 IDLE --\r\n" in lines


@given(st.binary(max_size=60))
def test_no_line_breaks_the_controller(line):
    controller = ZaberSimulator(ZaberSettings(layout="mcc"), VirtualClock())
    for answer in controller.answer(line) + controller.answer(b"/" + line):
        assert re.fullmatch(rb"@\d\d \d+( \d+)? (OK|RJ) (IDLE|BUSY) (--|[A-Z]{2}) .+\r\n", answer)


def test_the_driver_moves_in_native_units_with_speed_and_acceleration():
    with zaber_cell(VirtualClock()) as cell:
        cell.stage.move(np.array([10.0, 0.0, 40.0]))
        lines = []
        answer = cell.simulator.answer
        cell.simulator.answer = lambda line: (lines.append(line), answer(line))[1]
        cell.stage.move(np.array([10.5, 0.0, 40.0]), 5.0)
        moves = [line for line in lines if b"move" in line]
        assert len(moves) == 1
        assert re.match(rb"/1 1 \d\d move abs 220472 172010 688:", moves[0])
        assert len(lines) <= 3
