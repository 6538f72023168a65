"""Scan plans measured on exact surfaces beside noether's published figures and an ideal plane slice.

    python -m benchmarks.planning [--quick]

Plans are made on 1 mm meshes and measured against the exact surface: 200 000
area-uniform spots (seed 7), spacing from chord and exact normals, row distance
within 30 degrees of straight across. noether 0.16 is not run here: its column
holds the figures measured once with the same definitions, best of its planners
and directions. The plane slice - parallel planes a pitch apart, points at
exact arc length - runs beside the planner in this program.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.planning_measures import Measures, measured, rows_of
from benchmarks.planning_pictures import draw_points
from benchmarks.planning_surfaces import Truth, rough, truths
from benchmarks.validation_page import write_section
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.parts import named_part
from eddyscan.core.plan import ScanPlan
from eddyscan.core.technique import Technique
from eddyscan.planning import plan
from eddyscan.planning.families import even_levels
from eddyscan.planning.levels import level_lines
from eddyscan.planning.smooth import smoothed
from eddyscan.planning.strokes import stroke_from_line
from eddyscan.planning.topology import edges_of

PITCH_MM = 5.0
SPEED_MM_S, ACCELERATION_MM_S2 = 50.0, 500.0

# noether 0.16.0, 5 mm, measured once; not run by this program.
NOETHER = {
    "sinusoid": (97.5, 5.0, 2.43, 100, "0.24 / 1.2", 1.04),
    "dome": (77.4, 22.3, 3.30, 40, "1.90 / 7.1", 0.84),
    "blade": (98.8, 5.0, 1.76, 100, "7.41 / 14.9", 1.10),
    "sinusoid with hole": (97.4, 5.0, 3.71, 100, "0.25 / 1.1", 1.08),
    "closed cylinder": (97.5, 5.0, None, None, "-", None),
}
REQUIRED = {
    "sinusoid": (99.9, 2.7, 0.05, 98, 0.1, 0.5, 1.06),
    "dome": (99.9, 3.0, 0.15, 98, 0.1, 0.5, 1.06),
    "blade": (99.9, 2.7, 0.05, 98, 0.1, 0.5, 1.06),
    "sinusoid with hole": (99.5, 3.0, None, None, 0.1, 0.5, 1.06),
    "closed cylinder": (99.9, 2.7, None, None, 0.1, 0.5, 1.06),
}


@dataclass(frozen=True)
class Run:
    """A plan with what it is worth and what it cost."""

    plan: ScanPlan
    measures: Measures
    cpu_s: float


def technique(pitch_mm: float, **settings: object) -> Technique:
    base = {"strategy": "geodesic", "machine": "pose", "margin_mm": 0.0, "pitch_mm": pitch_mm, "step_mm": pitch_mm}
    return Technique.model_validate({"plan": base | settings})


def planned(truth: Truth, pitch_mm: float) -> Run:
    """Plan on a truth's mesh and measure it; CPU time of the second, warm run."""
    settings = technique(pitch_mm)
    plan(truth.mesh, settings, allow_gaps=True)
    began = time.process_time()
    result = plan(truth.mesh, settings, allow_gaps=True)
    cpu_s = time.process_time() - began
    normals = result.normal[result.is_scan]
    return Run(result, measured(rows_of(result), normals, truth, pitch_mm=pitch_mm, step_mm=pitch_mm), cpu_s)


def plane_slice(truth: Truth) -> Measures:
    """Cut the mesh with planes of constant y half a pitch inside both ends: exact arc length, smooth normals."""
    mesh = truth.mesh
    surface = smoothed(mesh.vertices, mesh.faces, PITCH_MM)
    y = surface.vertices[:, 1]
    edges, free = edges_of(surface.faces), np.ones(len(y))
    lines = level_lines(surface.vertices, surface.faces, edges, y, even_levels(y.min(), y.max(), PITCH_MM), free)
    strokes = [s for line in lines if (s := stroke_from_line(line, surface, technique(PITCH_MM).plan)) is not None]
    rows = [s.points for s in strokes if len(s.points) > 1]
    normals = np.concatenate([s.normals for s in strokes if len(s.points) > 1])
    return measured(rows, normals, truth, pitch_mm=PITCH_MM, step_mm=PITCH_MM)


def scan_time_ratio(run: Run, area_mm2: float) -> float:
    """Return the time of a constant-speed scan against the lower bound area / (pitch speed) + turns.

    A turn stops and starts (v / a) and moves one pitch across (2 sqrt(d / a));
    links longer than a pitch take their length at speed on top.
    """
    v, a, d = SPEED_MM_S, ACCELERATION_MM_S2, PITCH_MM
    turn = v / a + 2 * np.sqrt(d / a)
    rows = rows_of(run.plan)
    links = [float(np.linalg.norm(p[-1] - q[0])) for p, q in pairwise(rows)]
    real = run.measures.scan_mm / v + len(links) * turn + sum(max(0.0, link - d) / v for link in links)
    fewest = _fewest_turns(area_mm2, rows)
    return float(real / (area_mm2 / (d * v) + fewest * turn))


def _fewest_turns(area_mm2: float, rows: list[np.ndarray]) -> float:
    longest = max(float(np.linalg.norm(np.diff(row, axis=0), axis=1).sum()) for row in rows)
    return max(0.0, float(np.ceil(area_mm2 / PITCH_MM / longest)) - 1)


def table(runs: dict[str, Run], slices: dict[str, Measures], areas: dict[str, float]) -> str:
    head = (
        "| surface | planner | swept % | largest gap mm | spacing error max mm | rows within 5 % "
        "| normal error mean / max deg | points ratio | time ratio |\n|---|---|---|---|---|---|---|---|---|\n"
    )
    lines = []
    for name, run in runs.items():
        swept, radius, spacing, rows, normal, ratio = NOETHER[name]
        shown = ("-" if v is None else v for v in (spacing, rows, normal, ratio))
        lines.append(f"| {name} | noether 0.16 (published) | {swept} | {radius} | {' | '.join(map(str, shown))} | - |")
        lines.append(_line(name, "ideal plane slice", slices[name], "-"))
        lines.append(_line(name, "**eddyscan**", run.measures, f"{scan_time_ratio(run, areas[name]):.3f}"))
        lines.append(_required(name))
    return head + "\n".join(lines)


def _line(name: str, who: str, m: Measures, time_ratio: str) -> str:
    return (
        f"| {name} | {who} | {100 * m.swept:.2f} | {m.cover_radius_mm:.2f} | {m.spacing_error_mm:.3f} | "
        f"{100 * m.rows_within_5_percent:.1f} | {m.normal_mean_deg:.3f} / {m.normal_max_deg:.2f} | "
        f"{m.points_ratio:.3f} | {time_ratio} |"
    )


def _required(name: str) -> str:
    swept, radius, spacing, rows, mean, most, ratio = REQUIRED[name]
    space, within = "-" if spacing is None else f"<= {spacing}", "-" if rows is None else f">= {rows}"
    return (
        f"| {name} | *required* | >= {swept} | <= {radius} | {space} | {within} | <= {mean} / {most} | <= {ratio} "
        "| <= 1.10 |"
    )


def noise_table(blade: Truth) -> str:
    lines = ["| noise mm | normal error mean / max deg | noether 0.16, mean (published) |", "|---|---|---|"]
    for sigma, noether in ((0.02, 7.9), (0.05, 9.2), (0.10, 12.8)):
        m = planned(rough(blade, sigma), PITCH_MM).measures
        lines.append(f"| {sigma:.2f} | {m.normal_mean_deg:.2f} / {m.normal_max_deg:.2f} | {noether} |")
    return "\n".join(lines)


def times_table(surfaces: list[Truth], coarse: dict[str, Run]) -> str:
    lines = ["| surface | vertices | 5 mm, s | 0.5 mm, s | points at 0.5 mm |", "|---|---|---|---|---|"]
    for truth in surfaces:
        fine = planned(truth, 0.5)
        n = len(truth.mesh.vertices)
        cost = coarse[truth.name].cpu_s
        lines.append(f"| {truth.name} | {n} | {cost:.2f} | {fine.cpu_s:.2f} | {fine.plan.n_scan} |")
    return "\n".join(lines)


def million() -> str:
    """Plan a million points on a large plate-like sinusoid and tell time and memory."""
    part = named_part("block-c").top_mesh(1.0)
    mesh = SurfaceMesh.from_triangles(part.vertices, part.faces)
    began = time.process_time()
    result = plan(mesh, technique(0.148), allow_gaps=True)
    peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    cpu_s = time.process_time() - began
    return f"{result.n_scan} points in {result.n_rows} rows: {cpu_s:.1f} s of CPU, {peak_gb:.2f} GB at the most."


def report(tell: Callable[[str], None], *, quick: bool) -> None:
    surfaces = truths(n_samples=20_000 if quick else 200_000)
    runs = {truth.name: planned(truth, PITCH_MM) for truth in surfaces}
    slices = {truth.name: plane_slice(truth) for truth in surfaces}
    areas = {truth.name: truth.area_mm2 for truth in surfaces}
    parts = [table(runs, slices, areas)]
    tell(parts[0])
    noisy = noise_table(next(truth for truth in surfaces if truth.name == "blade"))
    tell(noisy)
    if quick:
        return
    times, many = times_table(surfaces, runs), million()
    tell(times)
    tell(many)
    picture = draw_points()
    write_section("planning", "Scan plans", page(parts[0], noisy, times, many, picture))


def page(main: str, noisy: str, times: str, many: str, picture: str) -> str:
    return f"""`python -m benchmarks.planning`

Pitch and step 5 mm, margin 0, 1 mm meshes with exact vertices, probe on the normal; measured on the exact surfaces
with {200_000} spots (seed 7). *noether 0.16 (published)* is a static baseline: measured once with the same definitions,
best of its planners, not run here. The ideal plane slice runs in the same program. Time ratio: constant speed
{SPEED_MM_S:g} mm/s, {ACCELERATION_MM_S2:g} mm/s^2, against area / (pitch x speed) + turns.

{main}

Gaussian noise along the normals of the blade's 1 mm mesh:

{noisy}

CPU time of one plan (second call; coverage check, probe poses, links and times included):

{times}

A million points on block-c: {many}

![{picture}](pictures/{picture})

Block-a as the reference study's figure 15 shows it: points at 5 mm along the contour, rows 5 mm apart."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer spots, no fine pitches, no page")
    report(print, quick=parser.parse_args().quick)


if __name__ == "__main__":
    main()
