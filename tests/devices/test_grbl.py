"""The GRBL driver keeps the promises of a stage; what is said on the wire."""

import contextlib
import re

import numpy as np
import pytest

from eddyscan.core.errors import LinkError, MotionError
from eddyscan.devices.clock import ScaledClock, VirtualClock
from eddyscan.devices.drivers.grbl import GrblStage, GrblStageSettings
from eddyscan.devices.link import RecordingLink, ReplayLink, TcpLink
from eddyscan.devices.sim.grbl import GrblSimulator
from eddyscan.devices.sim.grbl_settings import ROUTER_AXES, TILT_AXIS, GrblSettings
from tests.devices.stage_contract import StageContract


@contextlib.contextmanager
def grbl_cell(clock, *, tilt=False, **driver):
    axes = (*ROUTER_AXES, TILT_AXIS) if tilt else ROUTER_AXES
    simulator = GrblSimulator(GrblSettings(axes=axes), clock)
    host, port = simulator.start()
    if tilt:
        driver = {"axes": ("x", "y", "z", "b"), "lower": (0.0, 0.0, 0.0, -60.0), **driver}
    settings = GrblStageSettings(host=host, port=port, **{"dead_man": False, "answer_timeout_s": 0.5, **driver})
    try:
        stage = GrblStage(settings, clock)
        try:
            yield simulator, stage
        finally:
            stage.close()
    finally:
        simulator.close()


@pytest.fixture
def clock():
    return ScaledClock(40.0)


class TestGrblStage(StageContract):
    @pytest.fixture(params=["three axes", "with a tilt axis"])
    def stage(self, request, clock):
        with grbl_cell(clock, tilt="tilt" in request.param) as (_, stage):
            yield stage


@pytest.fixture
def cell():
    with grbl_cell(VirtualClock()) as (simulator, stage):
        stage.home()
        yield simulator, stage


def test_a_machine_without_reference_refuses_to_move():
    with grbl_cell(VirtualClock()) as (_, stage):
        assert not stage.is_homed()
        with pytest.raises(MotionError, match="answered error:9 to"):
            stage.move(np.array([100.0, 100.0, 50.0]))


def test_a_jammed_machine_is_given_up_on_progress(cell):
    simulator, stage = cell
    simulator.jammed = True
    with pytest.raises(MotionError, match="covered nothing for 1 s; it was told to hold"):
        stage.move(np.array([100.0, 100.0, 50.0]))


def test_a_silent_machine_is_told(cell):
    simulator, stage = cell
    simulator.silent = True
    with pytest.raises(LinkError, match=r"did not answer within 0\.5 s"):
        stage.position()


def test_a_cut_link_is_told(cell):
    simulator, stage = cell
    simulator.drop_link()
    with pytest.raises(LinkError, match=r"closed the link|is gone"):
        [stage.position() for _ in range(5)]


def test_nobody_there_is_told():
    with pytest.raises(LinkError, match=r"nobody answers at 127\.0\.0\.1:1"):
        GrblStage(GrblStageSettings(host="127.0.0.1", port=1), VirtualClock())


def test_moves_are_machine_coordinates_with_feed_in_mm_per_minute(cell):
    simulator, stage = cell
    lines = []
    answer = simulator.answer
    simulator.answer = lambda line: (lines.append(line), answer(line))[1]
    stage.move(np.array([290.0, 200.0, 60.0]), 5.0)
    assert lines == ["G53 G1 X-10.0000 Y0.0000 Z0.0000 F300.000"]


def test_status_and_settings_look_like_grbls():
    machine = GrblSimulator(GrblSettings(), VirtualClock())
    assert re.match(rb"<Alarm\|MPos:-240\.000,-140\.000,-30\.000\|FS:0,0>", machine.real_time(b"?")[0])
    assert b"$130=300.000" in machine.answer("$$")
    assert machine.answer("$H") == [b"ok"]
    assert machine.answer("G1 X-400 F100") == [b"error:15"]
    assert machine.answer("$X")[-1] == b"ok"
    assert machine.answer("G1 X-40 F100 Q1") == [b"error:20"]
    assert machine.answer("G53 G1 X-40 F1000") == [b"ok"]
    assert machine.real_time(b"?")[0].startswith(b"<Run")
    assert b"ALARM:3" in machine.real_time(b"\x18")


def test_a_recorded_session_replays(clock):
    machine = GrblSimulator(GrblSettings(), VirtualClock())
    host, port = machine.start()
    settings = GrblStageSettings(host=host, port=port, dead_man=False)
    recording = RecordingLink(TcpLink(host, port))
    target = np.array([250.0, 150.0, 40.0])
    try:
        _visit(GrblStage(settings, VirtualClock(), link=recording), target)
    finally:
        recording.close()
        machine.close()
    still = [(way, line) for way, line in recording.traffic if b"Run" not in line]
    assert any(line.startswith(b"G53 G1 X-50.0000") for _, line in still)
    _visit(GrblStage(settings, VirtualClock(), link=ReplayLink(recording.traffic)), target)
    with pytest.raises(LinkError, match="the recording has"):
        _visit(GrblStage(settings, VirtualClock(), link=ReplayLink(recording.traffic)), target + 1.0)


def _visit(stage, target):
    stage.home()
    stage.move(target, 10.0)
