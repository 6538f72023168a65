"""Running a plan: every reading once, in every mode, safe at the end of every fault."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from eddyscan.core.errors import LinkError, MotionError, ScanAborted, TechniqueError, TravelError
from eddyscan.core.record import POSITION_DOUBTFUL
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.sim.zaber import Fault
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.scanning import check, run
from tests.scanning.scan_cell import T_STAGE_PART, scan_cell, technique, wavy_plan

MODES = ["step", "row", "pvt"]


def layout(mode):
    return ZaberSettings(layout="mcc" if mode == "pvt" else "chain")


@pytest.fixture(params=MODES)
def mode(request):
    return request.param


@pytest.fixture
def cell(mode):
    with scan_cell(VirtualClock(), layout(mode)) as made:
        yield made


@pytest.fixture
def step_cell():
    with scan_cell(VirtualClock()) as made:
        yield made


def go(cell, plan, mode="step", **scan):
    run(plan, **cell.devices(), technique=technique(mode=mode, **scan), T_stage_part=T_STAGE_PART)


def lifted(cell, plan):
    """Return whether the axes rest with the probe above everything the plan touches."""
    cell.clock.sleep(1.0)
    top = (plan.T_part_probe[:, 2, 3] + T_STAGE_PART[2, 3]).max()
    return not cell.simulator.moving() and cell.simulator.true_position()[2] > top - 0.1


def test_every_planned_point_gets_one_reading_in_order(cell, mode):
    plan = wavy_plan()
    go(cell, plan, mode)
    keys = [(r.row, r.point) for r in cell.sink.readings]
    assert keys == [(int(r), int(p)) for r, p in zip(plan.row[plan.is_scan], plan.point[plan.is_scan], strict=True)]
    assert lifted(cell, plan)


def test_positions_are_those_of_the_reading_not_of_the_request(cell, mode):
    """Recorded minus true: the error map and the latency's remainder, the same both ways."""
    plan = wavy_plan(rows=4, points=21)
    go(cell, plan, mode)
    true = np.array(cell.instrument.true_mm[-plan.n_scan :])
    off = np.array([r.stage_mm for r in cell.sink.readings]) - true
    forward = np.array([r.row % 2 == 0 for r in cell.sink.readings])
    smear = off[forward, 0].mean() - off[~forward, 0].mean()
    assert abs(smear) < 0.05
    assert np.abs(off).max() < 0.1


def test_lift_off_is_kept_along_rows(cell, mode):
    plan = wavy_plan(rows=2, points=21)
    go(cell, plan, mode)
    at = np.array([r.stage_mm for r in cell.sink.readings]) - T_STAGE_PART[:3, 3]
    x = plan.T_part_probe[plan.is_scan][:21, 0, 3]
    ideal = CubicSpline(x, plan.T_part_probe[plan.is_scan][:21, 2, 3])
    assert np.percentile(np.abs(at[:, 2] - ideal(at[:, 0])), 95) < (0.06 if mode == "row" else 0.03)


def test_no_reading_of_a_good_scan_is_doubted(cell, mode):
    go(cell, wavy_plan(), mode)
    assert all(r.flag == 0 for r in cell.sink.readings)


def test_a_reading_is_durable_within_50_ms_or_before_the_next_move(cell, mode):
    stamps, waited = {}, []
    read = cell.instrument.read

    def stamped():
        heard = read()
        stamps[heard.impedance_ohm] = heard.time_s
        return heard

    cell.instrument.read = stamped
    cell.sink.on_write = lambda readings: waited.extend(
        cell.clock.now() - stamps[reading.impedance_ohm] for reading in readings
    )
    go(cell, wavy_plan(rows=2, points=21), mode)
    assert len(waited) == 42
    assert max(waited) <= 0.05


def test_settings_as_applied_are_noted(cell, mode):
    go(cell, wavy_plan(rows=1), mode)
    assert np.allclose(cell.sink.noted("T_stage_part")[0], T_STAGE_PART)
    assert cell.sink.noted("stage")[0]["kind"] == "zaber"
    assert cell.sink.noted("scan")[0]["mode"] == mode
    assert len(cell.instrument.configured) == 1
    if mode != "step":
        latency = cell.sink.noted("latency")[0]
        assert latency["seconds"] == pytest.approx(0.003, abs=0.001)
        assert latency["uncertainty_s"] < 0.002


def test_a_second_run_takes_only_what_is_missing(cell, mode):
    plan = wavy_plan()
    go(cell, plan, mode)
    everything = list(cell.sink.readings)
    for gap in (slice(4, 7), slice(20, None)):
        missing = everything[gap]
        cell.sink.readings = [r for r in everything if r not in missing]
        go(cell, plan, mode)
        assert [(r.row, r.point) for r in cell.sink.readings[-len(missing) :]] == [(r.row, r.point) for r in missing]
        assert len(cell.sink.readings) == len(everything)


def test_a_finished_scan_moves_nothing_over_the_part(step_cell):
    plan = wavy_plan(rows=1)
    go(step_cell, plan)
    before = step_cell.stage.position()
    go(step_cell, plan)
    assert step_cell.stage.position() == pytest.approx(before, abs=1e-6)


FAILURES = [LinkError("the instrument does not answer"), KeyboardInterrupt(), ScanAborted("a guard said so")]


@pytest.mark.parametrize("failure", FAILURES, ids=lambda f: type(f).__name__)
def test_whatever_the_instrument_does_the_probe_ends_lifted(cell, mode, failure):
    plan = wavy_plan()
    cell.instrument.fail_after, cell.instrument.failure = 140 if mode != "step" else 12, failure
    if mode != "step":
        go_until_rows_begin(cell, plan, mode)
    with pytest.raises(type(failure)):
        go(cell, plan, mode)
    assert 0 < len(cell.sink.readings) < plan.n_scan
    assert lifted(cell, plan)


def go_until_rows_begin(cell, plan, mode):
    """Measure how many reads the latency line takes, so that the fault falls into a row."""
    seen = []
    cell.sink.on_write = lambda readings: seen.append(len(cell.instrument.true_mm))
    failure, cell.instrument.failure = cell.instrument.failure, None
    cell.instrument.fail_after = None
    first = wavy_plan(rows=1, points=2)
    go(cell, first, mode)
    line = seen[0]
    cell.sink.on_write = None
    cell.instrument.true_mm.clear()
    cell.instrument.fail_after, cell.instrument.failure = line + 10, failure


def test_a_full_disk_loses_nothing_and_lifts(cell, mode):
    plan = wavy_plan()
    cell.sink.fail_after = 11
    with pytest.raises(OSError, match="No space left"):
        go(cell, plan, mode)
    assert len(cell.sink.readings) >= 11
    assert lifted(cell, plan)


def test_a_stall_is_told_and_the_probe_lifted(cell, mode):
    plan = wavy_plan()
    cell.simulator.inject(Fault("stall", axis="x", at=25.0))
    with pytest.raises(MotionError, match=r"axis x reports a stall \(FS\) at 2[45]\.\d\d\d mm"):
        go(cell, plan, mode)
    assert lifted(cell, plan)


def test_a_cut_link_is_survived_by_the_probe_and_the_record(cell, mode):
    plan = wavy_plan()
    cell.sink.on_write = lambda readings: (
        cell.simulator.inject(Fault("drop-link")) if len(cell.sink.readings) == 10 else None
    )
    with pytest.raises(LinkError):
        go(cell, plan, mode)
    assert lifted(cell, plan)
    cell.sink.on_write = None
    go(cell, plan, mode)
    keys = [(r.row, r.point) for r in cell.sink.readings]
    assert len(keys) == len(set(keys)) == plan.n_scan


def test_timed_points_on_a_chain_are_refused_before_the_probe_comes_down(step_cell):
    before = step_cell.stage.position()
    with pytest.raises(TechniqueError, match=r"scan\.mode is 'pvt', this stage .* offers step, row"):
        go(step_cell, wavy_plan(), "pvt")
    assert step_cell.stage.position()[2] == pytest.approx(before[2], abs=1e-3)


def test_a_reading_far_from_its_target_is_flagged(step_cell):
    move = step_cell.stage.move

    def miss(target, speed=None):
        move(np.asarray(target) + np.array([0.2, 0.0, 0.0]), speed)

    step_cell.stage.move = miss
    go(step_cell, wavy_plan(rows=1))
    assert all(r.flag & POSITION_DOUBTFUL for r in step_cell.sink.readings)


def test_the_probe_goes_up_first_and_down_last(step_cell):
    """No move at part height starts or ends a hop: across happens at the travelling height only."""
    moves = []
    move = step_cell.stage.move
    step_cell.stage.move = lambda target, speed=None: (
        moves.append((step_cell.stage.position(), np.array(target), speed)),
        move(target, speed),
    )
    step_cell.stage.move(np.array([150.0, 100.0, 3.0]))
    moves.clear()
    plan = wavy_plan(rows=1)
    go(step_cell, plan)
    (a, b, _), (c, d, _), *down = moves[:4]
    (e, f, slow) = down[-1]
    assert e[2] > f[2]
    assert b[2] > a[2]
    assert b[:2] == pytest.approx(a[:2], abs=1e-4)
    assert c[2] == pytest.approx(d[2], abs=1e-4)
    assert e[:2] == pytest.approx(f[:2], abs=1e-4)
    assert slow == technique().scan.approach_speed_mm_s
    last_from, last_to, _ = moves[-1]
    assert last_to[2] > last_from[2]


def test_a_plan_beyond_the_travel_is_refused_before_anything_moves(step_cell):
    far = T_STAGE_PART.copy()
    far[0, 3] = 190.0
    seen = step_cell.simulator.commands_seen
    with pytest.raises(TravelError, match=r"x = 230\.00 mm, travel 0\.00 to 203\.20 mm\. Move the part by 26\.8 mm"):
        check(wavy_plan(), step_cell.stage.axes(), far, technique())
    with pytest.raises(TravelError):
        run(wavy_plan(), **step_cell.devices(), technique=technique(), T_stage_part=far)
    assert step_cell.simulator.commands_seen == seen


def test_a_part_too_high_to_cross_over_is_refused(step_cell):
    high = T_STAGE_PART.copy()
    plan = wavy_plan(rows=1)
    keep = plan.is_scan
    high[2, 3] = step_cell.stage.axes()[2].upper - plan.T_part_probe[keep, 2, 3].max() - 0.2
    flat = wavy_plan(rows=1)
    flat.T_part_probe[~keep, 2, 3] = plan.T_part_probe[keep, 2, 3].max()
    with pytest.raises(TravelError, match=r"0\.20 mm of travel left, crossing over the part needs 1\.00 mm"):
        check(flat, step_cell.stage.axes(), high, technique())
