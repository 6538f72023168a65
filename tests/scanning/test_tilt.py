"""A tilt axis: the coil face is where the plan wants it, pointing where the plan points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import from_rotation_vector
from eddyscan.devices.clock import VirtualClock
from eddyscan.scanning import TiltHead, check, run
from tests.devices.test_grbl import grbl_cell
from tests.scanning.scan_cell import T_STAGE_PART, LiftOffInstrument, MemorySink, surface_z, technique, wavy_plan

HEAD = TiltHead(pivot_mm=40.0)
AWAY_FROM_THE_END = T_STAGE_PART + np.array([[0, 0, 0, 30.0], *[[0.0] * 4] * 3])
angles = st.floats(-50.0, 50.0)


def direction(angle_deg):
    R = from_rotation_vector(np.array([0.0, np.radians(angle_deg), 0.0]), np.zeros(3))[:3, :3]
    return R @ np.array([0.0, 0.0, -1.0])


@given(angles, st.tuples(*[st.floats(-100.0, 100.0)] * 3))
def test_axis_targets_put_the_face_there_and_point_the_probe(angle, place):
    face = np.array(place)
    target = HEAD.axis_targets(face[None], direction(angle)[None])[0]
    assert target[3] == pytest.approx(angle, abs=1e-9)
    assert HEAD.face(target) == pytest.approx(face, abs=1e-9)


def test_upright_is_the_carriage_itself():
    assert HEAD.axis_targets(np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, -1.0]]))[0] == pytest.approx(
        [1, 2, 3, 0]
    )


def test_a_lean_across_the_tilt_is_refused():
    leaning = np.array([[0.0, np.sin(0.2), -np.cos(0.2)]])
    with pytest.raises(TravelError, match=r"pose 0 leans 11\.5 deg along the tilt axis.*limit 3 deg"):
        HEAD.axis_targets(np.zeros((1, 3)), leaning)


def tilted_plan():
    """The wavy plan with the probe along the surface normal."""
    plan = wavy_plan(rows=2)
    for i in np.flatnonzero(plan.is_scan):
        x = plan.surface_mm[i, 0]
        slope = (surface_z(x + 1e-4) - surface_z(x - 1e-4)) / 2e-4
        down = np.array([slope, 0.0, -1.0]) / np.hypot(slope, 1.0)
        across = np.array([0.0, -1.0, 0.0])
        plan.T_part_probe[i, :3, :3] = np.column_stack([np.cross(across, down), across, down])
    return plan


def test_a_tilting_plan_on_three_axes_is_refused_before_anything_moves():
    with (
        grbl_cell(VirtualClock()) as (_, stage),
        pytest.raises(TravelError, match=r"tilts the probe by up to \d+\.\d deg"),
    ):
        check(tilted_plan(), stage.axes(), T_STAGE_PART, technique())


def test_a_scan_with_a_tilt_axis_records_the_coil_face():
    clock = VirtualClock()
    with grbl_cell(clock, tilt=True) as (simulator, stage):
        plan, sink = tilted_plan(), MemorySink()
        instrument = LiftOffInstrument(clock, simulator)
        where = {"stage": stage, "instrument": instrument, "clock": clock, "sink": sink}
        run(plan, **where, technique=technique(), T_stage_part=AWAY_FROM_THE_END, head=HEAD)
        faces = np.array([r.stage_mm for r in sink.readings])
        assert faces == pytest.approx(plan.T_part_probe[plan.is_scan, :3, 3] + AWAY_FROM_THE_END[:3, 3], abs=0.01)
        assert all(r.flag == 0 for r in sink.readings)


def test_the_tilt_axis_limits_count():
    clock = VirtualClock()
    with (
        grbl_cell(clock, tilt=True, lower=(0.0, 0.0, 0.0, -120.0)) as (_, stage),
        pytest.raises(TravelError, match=r"b = \d+\.\d\d deg, travel -120\.00 to 0\.00 deg"),
    ):
        check(tilted_plan(), stage.axes(), T_STAGE_PART, technique(), head=HEAD)
