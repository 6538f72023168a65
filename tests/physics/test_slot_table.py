import numpy as np
import pytest

from eddyscan.core.errors import TechniqueError
from eddyscan.physics import Coil, Conductor, PlacedSlot, Slot, SlotSolver, slot_table, slots_change_ohm, table_grid

PENCIL = Coil(0.5, 1.5, 1.0, 100)
ALUMINIUM = Conductor.half_space(19.0)
CRACK = Slot(3.0, 1.0, 0.02)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def table(cache):
    return slot_table(CRACK, PENCIL, ALUMINIUM, 5e5, cache=cache)


def test_table_equals_the_solver_between_its_nodes(table):
    solver = SlotSolver(CRACK, ALUMINIUM, 5e5, detail_mm=1.0)
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-5, 5, 100), rng.uniform(-3, 3, 100)
    for lift_off in (0.03, 0.17, 0.8):
        exact = solver.change_ohm(PENCIL, x, y, lift_off)
        error = np.abs(table.change_ohm(x, y, lift_off) - exact).max()
        assert error < 5e-4 * table.peak_ohm


def test_table_is_symmetric_about_both_axes(table):
    a = table.change_ohm(0.7, 0.4, 0.2)
    for x, y in ((-0.7, 0.4), (0.7, -0.4), (-0.7, -0.4)):
        assert table.change_ohm(x, y, 0.2) == a


def test_second_call_reads_the_same_numbers_from_disk(table, cache, monkeypatch):
    files = list(cache.glob("*.npz"))
    assert len(files) == 1
    monkeypatch.setattr("eddyscan.physics.tables.build_table", None)
    again = slot_table(CRACK, PENCIL, ALUMINIUM, 5e5, cache=cache)
    assert np.array_equal(again.values, table.values)


def test_a_damaged_table_is_computed_again(tmp_path):
    grid = table_grid(CRACK, PENCIL, counts=(5, 5, 4))
    first = slot_table(CRACK, PENCIL, ALUMINIUM, 5e5, grid=grid, cache=tmp_path)
    file = next(tmp_path.glob("*.npz"))
    file.write_bytes(file.read_bytes()[:200])
    assert np.allclose(slot_table(CRACK, PENCIL, ALUMINIUM, 5e5, grid=grid, cache=tmp_path).values, first.values)


def test_beyond_the_table_is_an_error_that_names_place_value_and_range(table):
    with pytest.raises(TechniqueError, match=r"position 1 of 2 .*\|x_mm\| = 9 \(allowed 0 to 5\.25\)"):
        table.change_ohm([0.0, -9.0], 0.0, 0.1)
    with pytest.raises(TechniqueError, match=r"lift_off_mm = 5 \(allowed 0 to 3\)"):
        table.change_ohm(0.0, 0.0, 5.0)


def test_zero_beyond_the_table_cuts_off_little(table):
    assert table.change_ohm(9.0, 0.0, 0.1, beyond_is_zero=True) == 0
    assert table.rim_fraction < 1e-3


def test_several_turned_slots_add_up(table):
    slots = [PlacedSlot(table, (0.0, 0.0), 90.0), PlacedSlot(table, (10.0, 2.0), 30.0)]
    direction = np.array([np.cos(np.radians(30)), np.sin(np.radians(30))])
    x, y = np.array([0.0, 10.0 + direction[0]]), np.array([1.0, 2.0 + direction[1]])
    assert np.allclose(slots_change_ohm(slots, x, y, 0.1), table.change_ohm(1.0, 0.0, 0.1), rtol=1e-9)
