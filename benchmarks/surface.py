"""The study's method and ours on the same virtual views: `python -m benchmarks.surface [sets] [first seed]`.

Pose sets are drawn at random from the seeds printed. The study's method gets what
the study had by hand: rough poses, here the truth turned by 4 degrees and moved
by 8 mm; ours gets the images alone.
"""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.validation_page import write_section
from eddyscan.core.errors import EddyscanError
from eddyscan.core.frames import from_rotation_vector, rotation_about_z, transform
from eddyscan.core.parts import PARTS, NominalPart, named_part
from eddyscan.core.technique import Surface
from eddyscan.devices.sim.camera import VirtualDepthCamera
from eddyscan.devices.sim.world_scene import build_scene
from eddyscan.devices.sim.world_settings import WorldCamera
from eddyscan.surface import compare, reconstruct

NAMES = ("block-a", "block-c", "freeform")
HEAD = "| part | seed | method | own mean / RMSE / p95 | best fit mean / RMSE / p95 / max | in 95 % own, fit | CPU s |"


def freeform_height(x, y):
    """Saddle, twist and a 7 mm boss with flanks up to 54 deg."""
    u, v, r = (x - 90) / 90, (y - 55) / 55, np.hypot(x - 120, y - 60)
    return 28 + 5 * (u**2 - v**2) + 4 * u * v + 3.5 * (1 - np.tanh((r - 15) / 2.47))


def freeform_surface(u, v):
    """Map u in [0, 1], v in [-1, 1] to a tapered outline of 180 x 110 mm."""
    x, y = 180 * u, 55 + v * (55 - 12 * u)
    return np.stack(np.broadcast_arrays(x, y, freeform_height(x, y)), axis=-1)


def views_of(name: str, seed: int):
    scene = build_scene(name, seed=seed, clutter=4, edge_mm=0.5)
    camera = VirtualDepthCamera(scene, WorldCamera(), seed)
    views, poses = camera.capture_views(5), camera.true_poses()
    return views, [np.linalg.inv(scene.T_table_part) @ T for T in poses]


def measured(mesh, name: str):
    """Compare both ways round: which end of a part is which is a rule, not a measurement."""
    length, width = 2 * named_part(name).top_mesh(4.0).vertices[:, :2].mean(axis=0)
    turned = mesh.moved(transform(rotation_about_z(180.0), (length, width, 0.0)), "part")
    return min((compare(m, named_part(name)) for m in (mesh, turned)), key=lambda c: c.own.mean_abs_mm)


def row(name: str, seed: int, label: str, views, settings: Surface) -> tuple[str, object]:
    begin = time.process_time()
    try:
        result = reconstruct(views, settings)
    except EddyscanError as error:
        return f"| {name} | {seed} | {label} | failed: {error} | | | |", None
    spent = time.process_time() - begin
    c = measured(result.mesh, name)
    inside = "-"
    if result.mesh.uncertainty_mm is not None:
        shares = []
        for d in (c.own, c.fit):
            known = np.isfinite(d.signed_mm)
            shares.append(np.mean(np.abs(d.signed_mm[known]) < 1.96 * result.mesh.uncertainty_mm[known]))
        inside = f"{100 * shares[0]:.0f} %, {100 * shares[1]:.0f} %"
    own = f"{c.own.mean_abs_mm:.3f} / {c.own.rmse_mm:.3f} / {c.own.p95_mm:.3f}"
    fit = f"{c.fit.mean_abs_mm:.3f} / {c.fit.rmse_mm:.3f} / {c.fit.p95_mm:.3f} / {c.fit.max_mm:.2f}"
    return f"| {name} | {seed} | {label} | {own} | {fit} | {inside} | {spent:.1f} |", c


def main() -> None:
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    PARTS["freeform"] = NominalPart("freeform", freeform_surface, (0.0, 1.0), (-1.0, 1.0))
    lines = [HEAD, "|---|---|---|---|---|---|---|"]
    good = total = 0
    for seed in range(first, first + sets):
        for name in NAMES:
            views, poses = views_of(name, seed)
            line, found = row(name, seed, "auto", views, Surface())
            total += 1
            good += found is not None and found.own.mean_abs_mm < 0.5
            lines.append(line)
            print(line, flush=True)
            if seed == first and (sets > 1 or name == NAMES[0]):  # the slow one: once per part, or once in all
                rng = np.random.default_rng(seed)
                guess = [T @ from_rotation_vector(np.radians(4) * _unit(rng), 8 * _unit(rng)) for T in poses]
                posed = [replace(v, T_world_camera=T) for v, T in zip(views, guess, strict=True)]
                line, _ = row(name, seed, "study, depth 5", posed, Surface(method="study"))
                lines.append(line)
                print(line, flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    text = (
        f"`python -m benchmarks.surface {sets} {first}` - virtual OS30A, 5 views, 260-320 mm, least range and clutter "
        f"on, seeds {first} to {first + sets - 1}. Deviations in mm along the normal over the whole top face.\n\n"
        + "\n".join(lines)
        + f"\n\nRegistered without a guess: {good} of {total} pose sets. Peak memory of the whole run {peak:.0f} MB."
    )
    print(text.rsplit("\n", 1)[-1])
    write_section("surface", "Surface: views to mesh, the study's method and ours", text)


def _unit(rng: np.random.Generator):
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


if __name__ == "__main__":
    main()
