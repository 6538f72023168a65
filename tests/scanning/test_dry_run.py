"""What would move, in words."""

import numpy as np
import pytest

from eddyscan.core.errors import TravelError
from eddyscan.devices.clock import VirtualClock
from eddyscan.scanning import run, what_would_move
from eddyscan.scanning.dry_run import expected_s
from eddyscan.scanning.tilt import axis_targets
from tests.scanning.scan_cell import T_STAGE_PART, scan_cell, technique, wavy_plan
from tests.scanning.test_safety import AXES


def test_it_tells_readings_axes_and_time():
    plan = wavy_plan()
    lines = what_would_move(plan, AXES, T_STAGE_PART, technique(), done=frozenset({(0, 0), (0, 1)}))
    assert lines[0] == "mode step: 25 of 27 readings to take in 3 rows"
    assert "axis x: 5.00 to 45.00 mm of 0.00 to 203.20 mm" in lines
    assert lines[-1].startswith("about 0.")


def test_it_refuses_what_check_refuses():
    far = T_STAGE_PART.copy()
    far[0, 3] = 190.0
    with pytest.raises(TravelError, match="outside the stage's travel"):
        what_would_move(wavy_plan(), AXES, far, technique())


@pytest.mark.parametrize("mode", ["step", "row"])
def test_the_expected_time_is_about_what_it_takes(mode):
    with scan_cell(VirtualClock()) as cell:
        plan, given = wavy_plan(rows=4, points=21), technique(mode=mode)
        targets, _ = axis_targets(plan, T_STAGE_PART, 3, None)
        expected = expected_s(plan, targets, cell.stage.axes(), given)
        run(plan, **cell.devices(), technique=given, T_stage_part=T_STAGE_PART)
        times = np.array([r.time_s for r in cell.sink.readings])
        assert times[-1] - times[0] == pytest.approx(expected, rel=0.3)
