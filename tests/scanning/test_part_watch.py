"""A part that moved during the scan is noticed."""

import numpy as np
import pytest

from eddyscan.core.errors import ScanAborted
from eddyscan.devices.clock import VirtualClock
from eddyscan.scanning import run
from tests.scanning.scan_cell import T_STAGE_PART, scan_cell, technique, wavy_plan


@pytest.fixture(params=["step", "row"])
def cell(request):
    with scan_cell(VirtualClock()) as made:
        made.mode = request.param
        yield made


def go(cell, plan, **scan):
    run(plan, **cell.devices(), technique=technique(mode=cell.mode, watch_rows=2, **scan), T_stage_part=T_STAGE_PART)


def events(cell, what):
    return [e for e in cell.sink.noted("event") if e["event"] == what]


def test_a_part_that_stays_is_looked_at_after_every_block_of_rows(cell):
    plan = wavy_plan(rows=6, points=4)
    go(cell, plan)
    looks = events(cell, "reference point again")
    assert len(looks) == 3
    assert all(look["change_mm"] < 0.05 for look in looks)
    assert len(cell.sink.readings) == plan.n_scan


@pytest.mark.parametrize("shift", [(0.0, 0.0, -0.4), (1.0, 0.0, 0.0)], ids=["sunk", "slid along the slope"])
def test_a_part_that_moved_is_told_with_amount_and_limit(cell, shift):
    plan = wavy_plan(rows=6, points=4)
    cell.sink.on_write = lambda readings: (
        setattr(cell.instrument, "shift_mm", np.array(shift)) if readings[0].row >= 2 else None
    )
    with pytest.raises(ScanAborted, match=r"the part moved: .* by 0\.\d\d mm of lift-off \(limit 0\.15\)"):
        go(cell, plan)
    assert {r.row for r in cell.sink.readings} == {0, 1, 2, 3}


def test_a_reference_without_contrast_is_told_and_does_not_stop_the_scan(cell):
    if cell.mode == "row":
        pytest.skip("without contrast there is no latency to measure either")
    steady = cell.instrument.read()
    cell.instrument.read = lambda: steady
    go(cell, wavy_plan(rows=3, points=3))
    assert len(events(cell, "reference point tells nothing: no contrast with lift-off")) == 1


def test_the_watch_can_be_switched_off(cell):
    run(
        wavy_plan(rows=2, points=3),
        **cell.devices(),
        technique=technique(mode=cell.mode, watch_rows=0),
        T_stage_part=T_STAGE_PART,
    )
    assert not events(cell, "reference point")
