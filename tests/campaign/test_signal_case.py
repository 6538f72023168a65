"""A signal case: pure in its values and seed, its crack from tables true to the solver."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eddyscan.campaign.library import build_library
from eddyscan.campaign.run import run_campaign
from eddyscan.campaign.signal_case import SignalShared, run_signal_case
from eddyscan.campaign.values import SignalValues
from eddyscan.core.technique import Technique
from eddyscan.physics import Coil, Conductor, Slot
from eddyscan.physics.sound_response import technique_coil
from eddyscan.physics.tables import TableGrid, build_table

FREQUENCY_HZ = 500e3
METAL = Conductor.half_space(Technique().part.conductivity_ms_m)


def coil() -> Coil:
    return technique_coil(Technique())


def test_tables_between_their_nodes_are_within_one_percent_of_the_solver() -> None:
    ratio, opening_mm = 0.33, 0.05
    library = build_library(
        coil(),
        METAL,
        FREQUENCY_HZ,
        opening_mm=opening_mm,
        lengths_mm=(0.7, 1.3),
        depths_mm=ratio,
        largest_lift_off_mm=0.5,
    )
    length_mm = float(np.sqrt(library.lengths_mm[1] * library.lengths_mm[2]))
    table = library.table(length_mm, ratio * length_mm)
    rng = np.random.default_rng(0)
    places = TableGrid(
        tuple(np.sort(rng.uniform(0.0, library.grid.x_mm[-1], 6)).tolist()),
        tuple(np.sort(rng.uniform(0.0, library.grid.y_mm[-1], 6)).tolist()),
        tuple(np.sort(rng.uniform(0.02, 0.5, 4)).tolist()),
    )
    slot = Slot(length_mm=length_mm, depth_mm=ratio * length_mm, opening_mm=opening_mm)
    exact = build_table(slot, coil(), METAL, FREQUENCY_HZ, grid=places).values
    x, y, h = np.meshgrid(places.x_mm, places.y_mm, places.lift_off_mm, indexing="ij")
    assert np.abs(table.change_ohm(x, y, h) - exact).max() < 0.01 * table.peak_ohm


@pytest.fixture
def shared(small_tables: None) -> SignalShared:
    library = build_library(
        coil(),
        METAL,
        FREQUENCY_HZ,
        opening_mm=0.1,
        lengths_mm=(3.0, 3.0),
        depths_mm=(1.0, 1.0),
        largest_lift_off_mm=0.4,
    )
    return SignalShared(Technique(), {(FREQUENCY_HZ, 0.1): library})


def case(**values: float) -> dict[str, object]:
    given = {"flaw_length_mm": 3.0, "flaw_depth_mm": 1.0, "field_mm": 30.0, "pitch_mm": 1.0, "step_mm": 1.0} | values
    return {"case": 0, "seed": 11, **SignalValues.model_validate(given).model_dump()}


def test_a_large_crack_is_found_where_it_is(shared: SignalShared) -> None:
    row = run_signal_case(shared, case())
    assert row["found"]
    assert row["score"] > 2 * row["threshold"]
    assert row["position_error_mm"] < 1.0


def test_a_case_depends_on_nothing_but_its_values_and_seed(shared: SignalShared) -> None:
    first, again, other = (run_signal_case(shared, case() | {"seed": seed}) for seed in (11, 11, 12))
    without_time = {name: value for name, value in first.items() if name != "seconds"}
    assert without_time == {name: value for name, value in again.items() if name != "seconds"}
    assert other["score"] != first["score"]


def test_a_crack_drowned_in_noise_is_missed(shared: SignalShared) -> None:
    assert not run_signal_case(shared, case(noise=0.05))["found"]


def test_the_same_campaign_on_one_worker_and_stopped_half_way(
    small_tables: None, small_campaign: Path, tmp_path: Path
) -> None:
    whole = rows_of(run_campaign(small_campaign, tmp_path / "whole"))
    with pytest.raises(KeyboardInterrupt):
        run_campaign(small_campaign, tmp_path / "stopped", progress=stop_at(3))
    assert 0 < len(list((tmp_path / "stopped").glob("rows-*.parquet"))) < 8
    assert rows_of(run_campaign(small_campaign, tmp_path / "stopped")) == whole
    assert [row["case"] for row in whole] == list(range(8))


def stop_at(count: int):
    def progress(what: str, done: int, total: int) -> None:
        if what == "cases" and done >= count:
            raise KeyboardInterrupt

    return progress


def rows_of(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]
