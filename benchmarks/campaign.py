"""Campaigns: what a case costs, what the cluster adds, the POD estimator, and records of any size in pieces.

`python -m benchmarks.campaign [--rows DIR]` prints the tables and writes them into
docs/validation.md. The machine may be shared, so CPU seconds stand beside the wall's.
`--rows` is the folder of a finished `eddyscan campaign` of docs/how-to/run-a-campaign.md.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from benchmarks.campaign_blocks import block_rows
from benchmarks.validation_page import PICTURES, write_section
from eddyscan.analysis.pod import PodCurve, pod_from_hits, pod_from_signals
from eddyscan.campaign.engine import run_batches
from eddyscan.campaign.library import build_library
from eddyscan.campaign.pod_picture import draw_pod
from eddyscan.campaign.signal_case import SignalShared, run_signal_cases
from eddyscan.campaign.store import RowStore
from eddyscan.campaign.values import SignalValues
from eddyscan.core.technique import Technique
from eddyscan.physics import Conductor
from eddyscan.physics.sound_response import technique_coil

FREQUENCY_HZ, OPENING_MM = 500e3, 0.03
EMPTY_CASES = 4000
WARM_BATCHES = 4  # both workers have imported everything by then
TRIALS = 200


def shared() -> SignalShared:
    """Return the crack responses of 0.3 to 1.2 mm long, a third as deep."""
    technique = Technique()
    library = build_library(
        technique_coil(technique),
        Conductor.half_space(technique.part.conductivity_ms_m),
        FREQUENCY_HZ,
        opening_mm=OPENING_MM,
        lengths_mm=(0.3, 1.2),
        depths_mm=0.333,
        largest_lift_off_mm=0.35,
    )
    return SignalShared(technique, {(FREQUENCY_HZ, OPENING_MM): library})


def signal_cases(count: int) -> list[dict[str, Any]]:
    """Return cases on 40 x 40 mm at 0.5 mm pitch and step."""
    lengths = np.geomspace(0.3, 1.2, count)
    return [
        {
            "case": k,
            "seed": 100 + k,
            **SignalValues(
                flaw_length_mm=length, flaw_depth_mm=0.333 * length, flaw_opening_mm=OPENING_MM
            ).model_dump(),
        }
        for k, length in enumerate(lengths.tolist())
    ]


def timed_cases(tables: SignalShared, batch: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return rows with the CPU and the wall seconds of their batch."""
    cpu, wall = time.process_time(), time.perf_counter()
    rows = run_signal_cases(tables, batch)
    spent = {"cpu_s": (time.process_time() - cpu) / len(rows), "wall_s": (time.perf_counter() - wall) / len(rows)}
    return [row | spent for row in rows]


def empty_cases(_tables: None, batch: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return rows of nothing: what remains is the engine's own time."""
    return [{"case": case["case"]} for case in batch]


def case_cost(tables: SignalShared, count: int) -> list[list[str]]:
    """Time cases on one process and on two."""
    cases = signal_cases(count)
    timed_cases(tables, cases[:2])
    alone = timed_cases(tables, cases)
    cpu, wall = (float(np.mean([row[name] for row in alone])) for name in ("cpu_s", "wall_s"))
    began = 0.0
    rows: list[dict[str, Any]] = []
    for number, batch in enumerate(run_batches(timed_cases, tables, cases * 3, workers=2)):
        if number < WARM_BATCHES:
            began = time.perf_counter()
        else:
            rows += batch
    two = (time.perf_counter() - began) / len(rows)
    two_cpu = float(np.mean([row["cpu_s"] for row in rows]))
    return [
        ["signal cases per minute on 2 cores, by CPU time", ">= 600", f"{120 / cpu:.0f} ({cpu:.3f} CPU s per case)"],
        ["the same by the wall, 1 process", "", f"{60 / wall:.0f} per minute"],
        ["two workers against one, wall", ">= 1.8", f"{wall / two:.2f}"],
        ["CPU s per case, one process and two workers", "", f"{cpu:.3f} and {two_cpu:.3f}"],
    ]


def overhead() -> list[list[str]]:
    """Time what the engine adds to a case, workers already up."""
    cases = [{"case": k} for k in range(EMPTY_CASES)]
    began, done, cpu = 0.0, 0, 0.0
    for rows in run_batches(empty_cases, None, cases, workers=2):
        if not done:
            began, cpu = time.perf_counter(), time.process_time()
        done += len(rows)
    wall_ms, cpu_ms = (1e3 * spent / done for spent in (time.perf_counter() - began, time.process_time() - cpu))
    return [["scheduler overhead per case", "<= 5 ms", f"{wall_ms:.2f} ms wall, {cpu_ms:.2f} ms CPU"]]


def estimator() -> list[list[str]]:
    """Draw data from a known curve many times and count how often a90/95 lies above the true a90."""
    truth = float(np.exp((np.log(6.0) - 3.0 + norm.ppf(0.9) * 0.3) / 1.8))
    rows = []
    for name, curves in (("hit/miss", _curves(hits=True)), ("signal, censored", _curves(hits=False))):
        fits = list(curves)
        held = float(np.mean([fit.a90_95_mm >= truth for fit in fits]))
        middle = float(np.median([fit.a90_mm for fit in fits]))
        limit = f"0.95 +- {2 * np.sqrt(0.95 * 0.05 / TRIALS):.2f}"
        rows.append([f"POD, {name}: a90/95 above the true a90 ({truth:.3f} mm)", limit, f"{held:.3f}"])
        rows.append([f"POD, {name}: median a90 over the true one", "1", f"{middle / truth:.3f}"])
    return rows


def _curves(*, hits: bool) -> Iterator[PodCurve]:
    for seed in range(TRIALS):
        rng = np.random.default_rng(seed)
        size = np.exp(rng.uniform(np.log(0.2), np.log(1.2), 300))
        signal = np.exp(3.0 + 1.8 * np.log(size) + 0.3 * rng.standard_normal(300))
        if hits:
            yield pod_from_hits(size, signal > 6.0, basis="drawn")
        else:
            yield pod_from_signals(size, np.clip(signal, 4.5, 24.0), threshold=6.0, basis="drawn", limits=(4.5, 24.0))


def pod(folder: Path) -> list[list[str]]:
    """Read a campaign's rows, fit hits and misses and draw them."""
    rows = RowStore(folder, {}).rows()
    sizes = np.array([row["flaw_length_mm"] for row in rows])
    found = np.array([row["found"] for row in rows])
    curve = pod_from_hits(sizes, found, basis="simulation")
    draw_pod(sizes, found, [curve], PICTURES / "campaign-pod.png")
    area_m2 = sum(float(row["field_mm"]) ** 2 for row in rows) * 1e-6
    calls = str(sum(row["false_calls"] for row in rows))
    figures = f"a90 {curve.a90_mm:.3f}, a90/95 {curve.a90_95_mm:.3f} mm"
    return [
        [f"POD at 0.5 mm pitch in block-a's metal, {len(rows)} cases, {curve.method}", "", figures],
        [f"false calls on {area_m2:.2f} m2", "", calls],
    ]


def main() -> None:
    """Print the tables and write their section."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, help="Rows of the POD campaign.")
    parser.add_argument("--cases", type=int, default=40)
    parser.add_argument("--readings", type=float, nargs="*", default=[1e5, 3e5, 1e6])
    options = parser.parse_args()
    table = [*case_cost(shared(), options.cases), *overhead(), *estimator()]
    if options.rows is not None:
        table += pod(options.rows)
    blocks = block_rows([int(count) for count in options.readings])
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    table.append(["peak memory of this whole benchmark", "<= 2 GB", f"{peak_gb:.2f} GB"])
    text = _markdown(["", "must reach", "measured"], table)
    text += "\n\nA record in pieces to a C-scan (0.5 mm raster, 2 mm mesh, about 1e5 readings per piece):\n\n"
    text += _markdown(["readings", "pieces", "CPU s", "microseconds per reading", "peak so far GB"], blocks)
    if options.rows is not None:
        text += "\n\n![POD, simulation](pictures/campaign-pod.png)"
    print(text)
    head = "`python -m benchmarks.campaign --rows DIR`; simulation: physics and noise as assumed, no hardware. "
    head += "On a shared machine wall times and their ratio say little; CPU seconds decide.\n\n"
    write_section("campaign", "Campaigns and very large records", head + text)


def _markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


if __name__ == "__main__":
    main()
