"""CPU time, so that a busy machine does not fail the test; wall times stand in docs/validation.md."""

import time

import numpy as np

from eddyscan.physics import Coil, Conductor, LiftOffCurve, Slot, SlotSolver, build_table, table_grid

PENCIL = Coil(0.5, 1.5, 1.0, 100)
ALUMINIUM = Conductor.half_space(19.0)
CRACK = Slot(3.0, 1.0, 0.05)


def cpu_s(work, runs=3):
    times = []
    for _ in range(runs):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def test_crack_matrix_takes_half_a_second_at_most():
    assert cpu_s(lambda: SlotSolver(CRACK, ALUMINIUM, 5e5, detail_mm=1.0)) < 0.5


def test_table_and_its_hundred_thousand_readings():
    grid = table_grid(CRACK, PENCIL, counts=(41, 41, 12))
    begin = time.process_time()
    table = build_table(CRACK, PENCIL, ALUMINIUM, 5e5, grid=grid)
    assert time.process_time() - begin < 8.0
    rng = np.random.default_rng(1)
    x, y, h = rng.uniform(-5, 5, 100_000), rng.uniform(-3.7, 3.7, 100_000), rng.uniform(0, 2.5, 100_000)
    assert cpu_s(lambda: table.change_ohm(x, y, h)) < 0.15


def test_hundred_thousand_sound_readings():
    curve = LiftOffCurve(PENCIL, ALUMINIUM, 5e5)
    h = np.random.default_rng(1).uniform(0, 3, 100_000)
    assert cpu_s(lambda: curve.impedance_ohm(h)) < 0.15
