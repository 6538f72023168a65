"""The operator's keys."""

import numpy as np
import pytest

from eddyscan.devices.clock import VirtualClock
from eddyscan.scanning import JogSession
from tests.devices.zaber_cell import zaber_cell


@pytest.fixture
def session():
    with zaber_cell(VirtualClock()) as cell:
        cell.stage.move(np.array([50.0, 50.0, 20.0]))
        yield JogSession(cell.stage)


@pytest.mark.parametrize(
    ("key", "change"),
    [("left", (-1, 0, 0)), ("right", (1, 0, 0)), ("down", (0, -1, 0)), ("up", (0, 1, 0)), ("pageup", (0, 0, 1))],
)
def test_keys_move_their_axis_by_a_step(session, key, change):
    assert session.press(key).position == pytest.approx(np.array([50.0, 50.0, 20.0]) + change, abs=1e-3)


def test_the_step_has_ends(session):
    steps = [session.press(key).step_mm for key in ["+", "+", "-", "-", "-", "-", "-"]]
    assert steps == [10.0, 10.0, 1.0, 0.1, 0.01, 0.01, 0.01]


def test_down_is_short_and_slow_whatever_the_step(session):
    session.press("+")
    state = session.press("pagedown")
    assert state.position[2] == pytest.approx(19.0, abs=1e-3)
    assert state.message == "down only 1 mm at a time"


def test_the_end_of_travel_is_told_and_nothing_moves(session):
    session.press("+")
    for _ in range(5):
        session.press("left")
    state = session.press("left")
    assert 0.0 <= state.position[0] <= 10.0
    assert "outside its travel" in state.message


def test_points_are_collected_and_the_session_ends(session):
    session.press("enter")
    session.press("right")
    state = session.press("enter")
    assert [p[0] for p in state.points_mm] == pytest.approx([50.0, 51.0], abs=1e-3)
    assert state.message == "point 2 taken"
    assert session.press("q").done


def test_an_unknown_key_explains_itself(session):
    before = session.state.position
    state = session.press("x")
    assert "arrows: x and y" in state.message
    assert state.position == pytest.approx(before)


def test_space_stops_and_home_homes(session):
    assert session.press("space").message == "stopped"
    assert session.press("h").position[2] == pytest.approx(40.0, abs=0.01)
