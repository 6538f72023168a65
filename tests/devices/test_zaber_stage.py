"""The Zaber driver keeps the promises of a stage, on every controller and firmware."""

import numpy as np
import pytest

from eddyscan.core.errors import DeviceError, LinkError, MotionError
from eddyscan.devices.clock import ScaledClock, VirtualClock
from eddyscan.devices.drivers.zaber import ZaberStage
from eddyscan.devices.drivers.zaber_settings import STUDY_CHAIN, ZaberAxis, ZaberStageSettings
from eddyscan.devices.sim.zaber import Fault
from eddyscan.devices.sim.zaber_settings import STUDY_AXES, SimulatedAxis, ZaberSettings
from tests.devices.path_contract import PathContract, wave_path
from tests.devices.stage_contract import StageContract
from tests.devices.zaber_cell import zaber_cell

ROTARY = SimulatedAxis(
    name="b", model="rotary", unit="deg", serial_number=104, travel=90.0, microstep=0.0009375, lower=-45.0, start=0.0
)
TILT = ZaberAxis(name="b", model="rotary", device=4, unit="deg", travel=90.0, microstep=0.0009375, lower=-45.0)


@pytest.fixture
def clock():
    return ScaledClock(40.0)


class TestZaberStage(StageContract):
    @pytest.fixture(params=["chain-7", "chain-6", "controller", "with a rotary axis"])
    def stage(self, request, clock):
        settings, driver = {
            "chain-7": (ZaberSettings(), {}),
            "chain-6": (ZaberSettings(firmware="6.28"), {}),
            "controller": (ZaberSettings(layout="mcc"), {}),
            "with a rotary axis": (ZaberSettings(axes=(*STUDY_AXES, ROTARY)), {"axes": (*STUDY_CHAIN, TILT)}),
        }[request.param]
        with zaber_cell(clock, settings, home=False, **driver) as cell:
            yield cell.stage


HERE = np.array([50.0, 60.0, 30.0])
THERE = np.array([80.0, 65.0, 25.0])


@pytest.fixture
def cell():
    with zaber_cell(VirtualClock()) as made:
        made.stage.move(HERE)
        yield made


def test_all_axes_arrive_together(cell):
    """Halfway in time every axis is halfway: a straight line, also on a chain."""
    clock, simulator = cell.clock, cell.simulator
    seen = []
    answer = simulator.answer
    simulator.answer = lambda line: (seen.append((clock.now(), simulator.true_position())), answer(line))[1]
    cell.stage.move(THERE, 5.0)
    share = np.array([(p - HERE) / (THERE - HERE) for _, p in seen])
    middle = share[(share[:, 0] > 0.3) & (share[:, 0] < 0.7)]
    assert len(middle) > 5
    assert np.ptp(middle, axis=1).max() < 0.02


def test_a_stall_is_told_with_axis_and_place(cell):
    cell.simulator.inject(Fault("stall", axis="x", at=60.0))
    with pytest.raises(MotionError, match=r"axis x reports a stall \(FS\) at 60\.0\d\d mm; all axes were told to stop"):
        cell.stage.move(THERE)
    assert not cell.simulator.moving()


def test_a_lost_reference_is_told(cell):
    cell.simulator.inject(Fault("power-cycle", after=3))
    with pytest.raises(MotionError, match=r"axis x reports a lost reference \(WR\)"):
        cell.stage.move(THERE)
    assert not cell.stage.is_homed()
    cell.stage.home()
    cell.stage.move(THERE)
    assert cell.stage.position() == pytest.approx(THERE, abs=1e-3)


def test_a_driver_that_went_off_is_told(cell):
    cell.simulator.inject(Fault("driver-off", axis="z"))
    with pytest.raises(MotionError, match=r"driver off"):
        cell.stage.move(THERE)


def test_a_move_cut_short_by_somebody_else_is_noticed(cell):
    answer = cell.simulator.answer
    meddled = []

    def meddle(line):
        if b"get pos" in line and not meddled and cell.simulator.moving():
            meddled.append(True)
            answer(b"/1 1 stop\n")
        return answer(line)

    cell.simulator.answer = meddle
    with pytest.raises(MotionError, match=r"axis x stands -\d+\.\d+ mm from its target 80\.0000 \(limit 0\.002\)"):
        cell.stage.move(THERE)


def test_a_stage_that_says_busy_for_ever_is_given_up_on_progress_not_time(cell):
    axis = cell.simulator.axes[0]
    slow = np.array([HERE[0] + 4.0, HERE[1], HERE[2]])
    before = cell.clock.now()
    cell.stage.move(slow, 0.5)
    assert cell.clock.now() - before > 4 * cell.stage.settings.no_progress_s
    axis.update = lambda now: False
    axis.state = lambda now: (1e6, 0.0)
    axis.go = lambda *a, **k: setattr(axis, "busy", True)
    with pytest.raises(MotionError, match=r"covered nothing for 1 s \(x at 47\.625 mm"):
        cell.stage.move(THERE)


@pytest.mark.parametrize("kind", ["garble", "silence"])
def test_one_bad_answer_to_a_position_request_is_asked_again(cell, kind):
    cell.simulator.inject(Fault(kind))
    assert cell.stage.position() == pytest.approx(HERE, abs=1e-3)


@pytest.mark.parametrize("kind", ["garble", "silence"])
def test_a_stage_that_gives_no_usable_answer_is_told(cell, kind):
    cell.simulator.inject(Fault(kind, count=3))
    with pytest.raises(LinkError, match=r"no usable answer to 'get pos' within 0\.5 s"):
        cell.stage.position()


def test_a_cut_link_is_told_and_stop_opens_it_again(cell):
    cell.simulator.inject(Fault("drop-link", after=4))
    with pytest.raises(LinkError):
        cell.stage.move(np.array([200.0, 60.0, 30.0]), 5.0)
    cell.stage.stop()
    cell.stage.position()
    cell.clock.sleep(1.0)
    assert not cell.simulator.moving()
    assert cell.stage.position()[0] < 60.0


def test_nobody_at_the_address_is_told():
    settings = ZaberStageSettings(host="127.0.0.1", port=1)
    with pytest.raises(LinkError, match=r"the Zaber stage at 127\.0\.0\.1:1 does not answer"):
        ZaberStage(settings, VirtualClock())


def test_a_chain_in_the_wrong_order_is_refused():
    swapped = (STUDY_CHAIN[0], *(a.model_copy(update={"device": 5 - a.device}) for a in STUDY_CHAIN[1:]))
    with (
        pytest.raises(DeviceError, match=r"axis y \(device 3\) reports 20\.00 mm of travel, the rig file says 203\.20"),
        zaber_cell(VirtualClock(), axes=swapped),
    ):
        pass


def test_firmware_6_gets_its_own_speed_back():
    with zaber_cell(VirtualClock(), ZaberSettings(firmware="6.28")) as cell:
        own = cell.simulator.axes[0].settings["maxspeed"]
        cell.stage.move(HERE, 3.0)
        assert cell.simulator.axes[0].settings["maxspeed"] < own
        cell.stage.close()
        assert cell.simulator.axes[0].settings["maxspeed"] == own


def test_what_the_stage_says_about_itself_is_kept(cell):
    told = dict(cell.stage.identity().settings)
    assert told["x.system.serial"] == "101"
    assert told["z.limit.max"] == "419948"
    assert told["y.version"] == "7.38"


def test_positions_are_whole_microsteps_and_truth_differs_by_the_error_map(cell):
    for x in np.linspace(5, 200, 40):
        cell.stage.move(np.array([x, 60.0, 30.0]))
        counts = cell.stage.position()[0] / STUDY_CHAIN[0].microstep
        assert counts == pytest.approx(round(counts), abs=1e-3)
    errors = []
    for x in np.linspace(0, 203, 60):
        cell.stage.move(np.array([x, 60.0, 30.0]))
        errors.append(cell.simulator.true_position()[0] - cell.stage.position()[0])
    assert 0.7 * 0.060 < np.ptp(errors) < 1.2 * 0.060


class TestZaberPaths(PathContract):
    @pytest.fixture(params=["chain-7", "chain-6", "serial-pace", "controller-row", "controller-pvt"])
    def path_stage(self, request):
        settings = {
            "chain-6": ZaberSettings(firmware="6.28"),
            "serial-pace": ZaberSettings(reply_delay_s=0.0043),
        }.get(request.param, ZaberSettings(layout="mcc" if "controller" in request.param else "chain"))
        clock = VirtualClock()
        with zaber_cell(clock, settings) as cell:
            self.cell = cell
            start = np.array([20.0, 30.0, 20.0])
            cell.stage.move(start)
            yield cell.stage, clock, "pvt" if request.param.endswith("pvt") else "row", start

    @pytest.fixture
    def at_rest(self, path_stage):
        return lambda: not self.cell.simulator.moving()


def test_a_chain_refuses_timed_points(cell):
    with pytest.raises(MotionError, match="this stage follows paths as row, not as pvt"):
        cell.stage.start_path(wave_path(HERE), "pvt")


def test_the_dead_man_stops_all_axes_and_lifts_the_probe(cell):
    cell.stage.move(THERE)
    for line in cell.stage._last_words().splitlines(keepends=True):
        cell.simulator.answer(line)
    cell.clock.sleep(5.0)
    assert not cell.simulator.moving()
    assert cell.simulator.true_position()[2] > 39.9
