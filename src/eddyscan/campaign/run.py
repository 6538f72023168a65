"""`eddyscan campaign`: draw the cases, run what is missing, keep every row as it comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from eddyscan.campaign.design import case_seeds, draw_cases
from eddyscan.campaign.engine import CaseFunction, run_batches
from eddyscan.campaign.full_case import full_cases, full_names, run_full_cases
from eddyscan.campaign.library import build_library
from eddyscan.campaign.settings import Campaign, Ratio
from eddyscan.campaign.signal_case import SignalShared, run_signal_cases
from eddyscan.campaign.store import RowStore
from eddyscan.campaign.values import signal_cases, signal_names
from eddyscan.core.errors import TechniqueError
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.inspection import read_toml, sha256_of_value
from eddyscan.physics import Conductor
from eddyscan.physics.sound_response import technique_coil

MOST_LIBRARIES = 12
HIGHEST = 1.3  # the tables reach this much above the largest lift-off


def run_campaign(
    file: Path,
    out: Path,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress = silent,
    say: Callable[[str], None] | None = None,
) -> list[dict[str, Any]]:
    """Run every case of CAMPAIGN.toml that `out` has no row of, and return all rows.

    Raises
    ------
    TechniqueError
        For an unknown parameter, an empty range or an impossible case: before anything runs.
    WorkError
        When the Dask cluster cannot be used or is lost; rows that came in are kept.
    """
    campaign = read_toml(file, Campaign)
    cases = _cases(campaign)
    identity = {"campaign_sha256": sha256_of_value(campaign), "name": campaign.campaign.name}
    store = RowStore(out, identity | {"eddyscan": version("eddyscan")})
    with store.owned():
        done = store.done()
        missing = [case for case in cases if case["case"] not in done]
        progress("cases", len(done), len(cases))
        if missing:
            function, shared = _work(campaign, cases, out, progress)
            count = len(done)
            for rows in run_batches(function, shared, missing, workers=workers, scheduler=scheduler, say=say):
                store.add(rows)
                count += len(rows)
                progress("cases", count, len(cases))
    return store.rows()


def _cases(campaign: Campaign) -> list[dict[str, Any]]:
    signal = campaign.campaign.depth == "signal"
    columns = draw_cases(campaign, signal_names() if signal else full_names())
    n = len(next(iter(columns.values()))) if columns else campaign.campaign.cases
    seeds = case_seeds(campaign, n)
    return signal_cases(columns, seeds, n) if signal else full_cases(columns, seeds, n)


def _work(campaign: Campaign, cases: list[dict[str, Any]], out: Path, progress: Progress) -> tuple[CaseFunction, Any]:
    if campaign.campaign.depth == "full":
        return run_full_cases, (campaign.technique, str(out / "inspections"))
    libraries = dict(_libraries(campaign, cases, campaign.technique, progress))
    return run_signal_cases, SignalShared(campaign.technique, libraries)


def _libraries(
    campaign: Campaign, cases: list[dict[str, Any]], technique: Technique, progress: Progress
) -> Iterator[tuple[tuple[float, float], Any]]:
    kinds = sorted({(case["frequency_hz"], case["flaw_opening_mm"]) for case in cases})
    if len(kinds) > MOST_LIBRARIES:
        raise TechniqueError(
            f"{len(kinds)} different pairs of frequency_hz and flaw.opening_mm need a table library each "
            f"(limit {MOST_LIBRARIES}). Vary them by a short list."
        )
    tied = campaign.vary.get("flaw.depth_mm")
    ratio = tied.times if isinstance(tied, Ratio) and tied.of == "flaw.length_mm" else None
    for frequency_hz, opening_mm in kinds:
        library = build_library(
            technique_coil(technique),
            Conductor.half_space(technique.part.conductivity_ms_m),
            frequency_hz,
            opening_mm=opening_mm,
            lengths_mm=_limits(cases, "flaw_length_mm"),
            depths_mm=_limits(cases, "flaw_depth_mm") if ratio is None else ratio,
            largest_lift_off_mm=HIGHEST * max(case["lift_off_mm"] + 4 * case["lift_off_sd_mm"] for case in cases),
            progress=progress,
        )
        yield (frequency_hz, opening_mm), library


def _limits(cases: list[dict[str, Any]], name: str) -> tuple[float, float]:
    values = [case[name] for case in cases]
    return min(values), max(values)
