"""The fault campaign: kill the program, cut the line, stall an axis - nothing lost, nothing doubled, axes at rest.

`make faults` runs it in full: 200 kills (SIGKILL) at random moments of a scan in
its own process against a simulated stage, then 200 random faults on the line and
in the stage. Seeds are printed; tests run a short form of both.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from benchmarks.fault_campaign import FASTER, LATEST_REST_S, Outcome, kill_campaign, link_campaign
from benchmarks.validation_page import write_section


def table(outcome: Outcome, what: str) -> str:
    told = ", ".join(f"{name} {count}" for name, count in outcome.told.most_common()) or "-"
    return (
        f"| {what} | {outcome.faults} | {outcome.finished} | {outcome.lost} | {outcome.doubled} | "
        f"{outcome.rewritten} | {outcome.moving} | {outcome.into_part} | {outcome.worst_clearance_mm:.2f} mm | {told} |"
    )


HEAD = """Every scan ran on until its plan was done, however often it was ended. Required: 0 from
"points lost" to "coil in the part".

    make faults

| campaign | faults | scans finished | points lost | doubled | rewritten | axes moving after | coil in the part | """
HEAD += "least clearance at rest | told as |\n|---|---|---|---|---|---|---|---|---|---|\n"


def _foot(seed: int, kills: Outcome) -> str:
    rest = f"After a kill the axes were at rest within {kills.slowest_rest_s:.2f} s of wall time"
    return f"\n\n{rest} (limit {LATEST_REST_S} s), on a clock that runs {FASTER:g} times faster. Seed {seed}.\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--faults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=20261122)
    parser.add_argument("--write", action="store_true", help="write the section of docs/validation.md")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        from zaber_motion import Library

        Library.enable_device_db_store(name)
        links = link_campaign(given.faults, given.seed, Path(name))
        kills = kill_campaign(given.kills, given.seed, Path(name))
    body = HEAD + table(kills, "kill -9") + "\n" + table(links, "line and stage faults") + _foot(given.seed, kills)
    print(body)
    for outcome in (kills, links):
        for fault, count in outcome.unexpected.items():
            print(f"UNEXPECTED {count} x {fault}", file=sys.stderr)
    if given.write:
        write_section("faults", "Faults: nothing lost, axes at rest", body)
    return 0 if kills.clean() and links.clean() else 1


if __name__ == "__main__":
    sys.exit(main())
