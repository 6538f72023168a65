"""The study's experiments 3.5: whether the stage goes where it is told.

    python -m benchmarks.stage_experiment [--write]

Block-a in x and z, the same points with y, then blocks b and c, on the simulated
chain with the vendor's library; mean and standard deviation off plan per axis
beside the study's, recorded and true positions told apart.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.validation_page import PICTURES, write_section
from eddyscan.core.frames import Array
from eddyscan.core.parts import named_part
from eddyscan.core.technique import Technique
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.zaber_settings import ZaberStageSettings
from eddyscan.devices.sim.zaber import ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings
from eddyscan.planning import plan as make_plan
from eddyscan.scanning.experiment import STUDY_UM, StageExperiment, stage_experiment

ORIGIN_MM = np.array([1.0, 50.0, -10.0])


def points(part: str, *, rows: bool) -> Array:
    """Return the plan's scan points on the stage (N, 3) [mm]: all rows, or the first alone."""
    plan = make_plan(named_part(part).top_mesh(1.0), Technique())
    chosen = plan.is_scan if rows else plan.is_scan & (plan.row == 0)
    return plan.T_part_probe[chosen, :3, 3] + ORIGIN_MM


def experiment(part: str, *, rows: bool) -> StageExperiment:
    from eddyscan.devices.drivers.zaber import ZaberStage

    clock = VirtualClock()
    simulator = ZaberSimulator(ZaberSettings(), clock)
    host, port = simulator.start()
    try:
        stage = ZaberStage(ZaberStageSettings(host=host, port=port, dead_man=False), clock)
        try:
            stage.home()
            return stage_experiment(stage, points(part, rows=rows), clock=clock, true_position=simulator.true_position)
        finally:
            stage.close()
    finally:
        simulator.close()


def table(results: dict[str, StageExperiment]) -> str:
    lines = ["| experiment | points | position | x [um] | y [um] | z [um] |", "|---|---|---|---|---|---|"]
    study = {axis: f"{mean:g} +- {sd:g}" for axis, (mean, sd) in STUDY_UM.items()}
    lines.append(f"| the study, block A in x and z | - | recorded | {study['x']} | - | {study['z']} |")
    for name, result in results.items():
        for kind, axes in result.statistics_um().items():
            told = " | ".join(f"{mean:.3f} +- {sd:.3f}" for mean, sd in axes.values())
            lines.append(f"| {name} | {len(result.planned_mm)} | {kind} | {told} |")
    return "\n".join(lines)


def pictures(results: dict[str, StageExperiment]) -> list[Path]:
    """Draw the study's figures 20 and 21: planned points and recorded positions."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    PICTURES.mkdir(parents=True, exist_ok=True)
    out = []
    flat, wide = results["block-a, x and z"], results["block-a, with y"]
    figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
    axes.plot(flat.planned_mm[:, 0], flat.planned_mm[:, 2], "o", mfc="none", color="#1f5fa8", label="planned")
    axes.plot(flat.recorded_mm[:, 0], flat.recorded_mm[:, 2], "x", color="#c8501e", ms=4, label="recorded")
    axes.set(xlabel="x [mm, stage]", ylabel="z [mm, stage]", title="Block-a, x and z (the study's figure 20)")
    axes.legend()
    out.append(PICTURES / "stage-experiment-xz.png")
    figure.savefig(out[-1], dpi=100)
    plt.close(figure)
    figure = plt.figure(figsize=(7, 4.5), layout="constrained")
    solid = figure.add_subplot(projection="3d")
    solid.plot(*wide.planned_mm.T, "-", color="#1f5fa8", lw=0.6, label="planned")
    solid.plot(*wide.recorded_mm.T, ".", color="#c8501e", ms=2, label="recorded")
    solid.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", title="Block-a with y (the study's figure 21)")
    solid.set_box_aspect((2, 1, 0.5))
    solid.legend()
    out.append(PICTURES / "stage-experiment-xyz.png")
    figure.savefig(out[-1], dpi=100)
    plt.close(figure)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write pictures and the section of docs/validation.md")
    given = parser.parse_args()
    from zaber_motion import Library

    with tempfile.TemporaryDirectory() as store:
        Library.enable_device_db_store(store)
        results = {
            "block-a, x and z": experiment("block-a", rows=False),
            "block-a, with y": experiment("block-a", rows=True),
            "block-b, with y": experiment("block-b", rows=True),
            "block-c, with y": experiment("block-c", rows=True),
        }
    body = "    python -m benchmarks.stage_experiment\n\n" + table(results)
    body += (
        "\n\nRecorded: what the controller counts, so the microstep (0.048 um in x and y, 0.095 um in z) is all that "
        "is left. True: the simulated axes' repeatable error (60 um, 35 um peak to peak, the study's table 3) and "
        "backlash, which no axis without an encoder can see.\n"
    )
    print(body)
    if given.write:
        names = [path.name for path in pictures(results)]
        body += "\n" + "\n".join(f"![planned and recorded positions](pictures/{name})" for name in names) + "\n"
        write_section("stage-experiment", "The study's stage experiment", body)


if __name__ == "__main__":
    main()
