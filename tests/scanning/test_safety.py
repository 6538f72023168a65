"""Keep-out zones, signals, a second Ctrl-C, a program that was held up."""

import os
import signal

import numpy as np
import pytest

from eddyscan.core.errors import ScanAborted, TravelError
from eddyscan.core.parts import named_part
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.protocols import Axis
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.scanning import KeepOut, check, run
from eddyscan.scanning.signals import ended_by_signals
from tests.scanning.scan_cell import T_STAGE_PART, scan_cell, technique, wavy_plan

AXES = (
    Axis("x", 0.0, 203.2, 5e-5, 29.0, 200.0),
    Axis("y", 0.0, 203.2, 5e-5, 29.0, 200.0),
    Axis("z", 0.0, 40.0, 1e-4, 24.0, 200.0),
)


@pytest.fixture
def cell():
    with scan_cell(VirtualClock()) as made:
        yield made


def go(cell, plan, mode="step"):
    run(plan, **cell.devices(), technique=technique(mode=mode), T_stage_part=T_STAGE_PART)


def lifted(cell, plan):
    cell.clock.sleep(1.0)
    top = (plan.T_part_probe[:, 2, 3] + T_STAGE_PART[2, 3]).max()
    return not cell.simulator.moving() and cell.simulator.true_position()[2] > top - 0.1


def test_a_plan_above_its_surface_passes():
    check(wavy_plan(), AXES, T_STAGE_PART, technique())


def test_a_corrected_plan_passes_though_it_lies_below_the_first_estimate_of_the_surface():
    plan = wavy_plan()
    plan.T_part_probe[:, 2, 3] -= 0.8
    check(plan, AXES, T_STAGE_PART, technique())


def test_a_link_through_the_part_is_refused():
    plan = wavy_plan()
    links = np.flatnonzero(~plan.is_scan)[1:]
    plan.T_part_probe[links, 2, 3] = 9.0
    with pytest.raises(
        TravelError, match=r"on its way to link pose 21 \(row 2\) the coil would go 1\.00 mm into the part"
    ):
        check(plan, AXES, T_STAGE_PART, technique())


def test_points_too_far_apart_for_a_crest_are_found_with_the_mesh():
    """Between two points the way is straight; only the surface itself shows what lies between."""
    block = named_part("block-a").top_mesh(2.0)
    plan = wavy_plan(rows=1, points=3, length_mm=160.0)
    x = plan.T_part_probe[plan.is_scan][:, 0, 3]
    heights = 30.0 + 7.5 * np.sin(2 * np.pi * x / 150.0)
    scan = np.flatnonzero(plan.is_scan)
    plan.T_part_probe[scan, 1, 3], plan.T_part_probe[scan, 2, 3] = 50.0, heights + 0.5
    plan.surface_mm[scan] = plan.T_part_probe[scan, :3, 3] - np.array([0, 0, 0.5])
    plan.T_part_probe[~plan.is_scan, :3, 3] = [0.0, 50.0, 38.0]
    low = T_STAGE_PART.copy()
    low[2, 3] = -10.0
    tall = (AXES[0], AXES[1], Axis("z", 0.0, 60.0, 1e-4, 24.0, 200.0))
    check(plan, tall, low, technique())
    with pytest.raises(TravelError, match=r"\d\.\d\d mm into the part at x = "):
        check(plan, tall, low, technique(), mesh=block)


def test_a_corrected_plan_carries_its_mesh_along_but_not_far():
    block, plan = named_part("block-a").top_mesh(2.0), wavy_plan(rows=1, points=41, length_mm=160.0)
    scan = np.flatnonzero(plan.is_scan)
    heights = 30.0 + 7.5 * np.sin(2 * np.pi * plan.T_part_probe[scan, 0, 3] / 150.0)
    plan.T_part_probe[scan, 1, 3], plan.T_part_probe[scan, 2, 3] = 50.0, heights + 0.5 - 0.8
    plan.T_part_probe[~plan.is_scan, :3, 3] = [0.0, 50.0, 38.0]
    low = T_STAGE_PART.copy()
    low[2, 3] = -10.0
    tall = (AXES[0], AXES[1], Axis("z", 0.0, 60.0, 1e-4, 24.0, 200.0))
    check(plan, tall, low, technique(), mesh=block)
    plan.T_part_probe[scan, 2, 3] -= 1.0
    with pytest.raises(TravelError, match=r"expects the surface -1\.8\d mm from where the mesh has it \(limit 1\.5\)"):
        check(plan, tall, low, technique(), mesh=block)


def test_a_clamp_in_the_way_of_the_probes_body_is_refused():
    clamp = KeepOut("left clamp", (20.0, 30.0, 0.0), (30.0, 37.0, 30.0))
    with pytest.raises(TravelError, match=r"enter the keep-out zone 'left clamp' by \d\.\d\d mm \(limit 0\)"):
        check(wavy_plan(), AXES, T_STAGE_PART, technique(), keep_out=(clamp,))
    away = KeepOut("left clamp", (20.0, 20.0, 0.0), (30.0, 35.0, 30.0))
    check(wavy_plan(), AXES, T_STAGE_PART, technique(), keep_out=(away,))


@pytest.mark.parametrize(
    ("number", "words"), [(signal.SIGTERM, "asked the program to end"), (signal.SIGHUP, "terminal")]
)
def test_a_signal_ends_the_scan_safely(cell, number, words):
    plan = wavy_plan()
    cell.sink.on_write = lambda readings: os.kill(os.getpid(), number) if len(cell.sink.readings) == 9 else None
    before = signal.getsignal(number)
    with pytest.raises(ScanAborted, match=f"{words}.*everything read so far is kept"):
        go(cell, plan)
    assert signal.getsignal(number) == before
    assert 9 <= len(cell.sink.readings) < plan.n_scan
    assert lifted(cell, plan)
    assert "ScanAborted" in cell.sink.noted("event")[-1]["why"]


def test_an_ignored_hangup_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with ended_by_signals():
            os.kill(os.getpid(), signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_second_ctrl_c_stops_the_lifting_too(cell):
    plan = wavy_plan()
    cell.instrument.fail_after, cell.instrument.failure = 9, KeyboardInterrupt()
    stops = []
    stop, position = cell.stage.stop, cell.stage.position

    def position_again():
        if stops:
            cell.stage.position = position
            raise KeyboardInterrupt
        return position()

    cell.stage.stop = lambda: (stops.append(True), stop())
    cell.stage.position = position_again
    with pytest.raises(KeyboardInterrupt):
        go(cell, plan)
    assert len(stops) == 2
    cell.clock.sleep(1.0)
    assert not cell.simulator.moving()
    assert len(cell.sink.readings) == 9


def test_a_probe_that_cannot_be_lifted_is_told(cell):

    def jam_and_fail():
        cell.stage.move = _refuse
        raise ScanAborted("a guard said so")

    cell.instrument.read = jam_and_fail
    with pytest.raises(ScanAborted, match="a guard said so") as told:
        go(cell, wavy_plan(rows=1))
    assert told.value.__notes__ == [
        "The probe could not be lifted: the axis is jammed. Lift it by hand before anything else moves."
    ]


def _refuse(target, speed=None):
    raise ScanAborted("the axis is jammed.")


@pytest.mark.parametrize("mode", ["row", "pvt"])
def test_a_program_held_up_in_a_row_drives_the_rest_of_it_again(mode):
    """A pause or a busy computer: the axes rest by themselves, no reading is invented, none is lost."""
    with scan_cell(VirtualClock(), ZaberSettings(layout="mcc" if mode == "pvt" else "chain")) as cell:
        plan = wavy_plan(rows=2, points=21)
        cell.sink.on_write = lambda readings: cell.clock.sleep(5.0) if len(cell.sink.readings) in (5, 6, 30) else None
        go(cell, plan, mode)
        keys = [(r.row, r.point) for r in cell.sink.readings]
        assert len(keys) == len(set(keys)) == plan.n_scan
        assert all(r.flag == 0 for r in cell.sink.readings)
        assert [e["event"] for e in cell.sink.noted("event")].count("held up") >= 2
