"""What the virtual cell's devices are like: depth error of the camera, exactness and speed of the probe.

python -m benchmarks.virtual_cell [--write]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from benchmarks.validation_page import write_section
from eddyscan.core.frames import apply
from eddyscan.core.technique import Drive
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.drivers.keysight_e4980a import KeysightE4980A, KeysightE4980ASettings
from eddyscan.devices.rig import open_rig, virtual_rig
from eddyscan.devices.sim.camera import VirtualDepthCamera
from eddyscan.devices.sim.camera_raycast import Raycaster
from eddyscan.devices.sim.instrument_physics import CoilResponse
from eddyscan.devices.sim.lcr import LcrSimulator
from eddyscan.devices.sim.world import CoilAtStage
from eddyscan.devices.sim.world_facts import facts_of
from eddyscan.devices.sim.world_probe import ProbeOverPart
from eddyscan.devices.sim.world_scene import OS30A, PART_SOLID, build_scene
from eddyscan.devices.sim.world_settings import WorldCamera, WorldSettings
from eddyscan.physics import Coil, Conductor, impedance_ohm, least_lift_off_mm

PARTS = ("block-a", "block-c", "dome", "blade")
SEED = 1
FREQUENCY_HZ = 500e3


def camera_table() -> list[str]:
    """Return one line per part: depth error on the part over five views, cost of a view."""
    lines = [
        "| part | robust sd mm | all pixels RMSE mm | off by > 2 mm % | part lost % | CPU s a view |",
        "|---|---|---|---|---|---|",
        "| aim: blocks at 225-300 mm | 0.21 | 1.5-1.75 | 0.6-1.0 | 5.6-7.5 | - |",
    ]
    for name in PARTS:
        scene = build_scene(name, seed=SEED, clutter=4, edge_mm=0.5)
        camera, caster = VirtualDepthCamera(scene, WorldCamera(), SEED), Raycaster(list(scene.meshes))
        camera.capture_views(1)
        before = time.process_time()
        views = camera.capture_views(5)
        cost = (time.process_time() - before) / 5
        errors, lost = [], []
        for view, pose in zip(views, camera.true_poses(5), strict=True):
            hits = caster.cast(OS30A, pose)
            on_part = hits.solid == PART_SOLID
            error = (view.depth_mm - hits.depth_mm)[on_part]
            lost.append(np.isnan(error).mean())
            errors.append(error[np.isfinite(error)])
        error = np.concatenate(errors)
        lines.append(
            f"| {name} at 260-320 mm | {1.4826 * np.median(np.abs(error)):.2f} | {np.sqrt((error**2).mean()):.2f} | "
            f"{100 * (np.abs(error) > 2).mean():.1f} | {100 * np.mean(lost):.1f} | {cost:.2f} |"
        )
    return lines


def physics_table() -> list[str]:
    """Return how far the fast response is from the exact integrals, relative to the air reactance."""
    coil, metal = Coil(0.5, 1.5, 1.0, 100), Conductor.half_space(19.0)
    response = CoilResponse(coil, metal, FREQUENCY_HZ)
    rng = np.random.default_rng(SEED)
    lines = ["| tilt deg | largest error, share of the air reactance |", "|---|---|"]
    for tilt in (0.0, 0.5, 3.0, 12.0, 31.0, 50.0):
        heights = least_lift_off_mm(coil, tilt) + rng.uniform(0.0, 3.0, 40)
        exact = impedance_ohm(coil, metal, FREQUENCY_HZ, heights, tilt)
        found = np.array([response.impedance_ohm(h, tilt) for h in heights])
        lines.append(f"| {tilt:g} | {np.abs(found - exact).max() / abs(response.air_ohm):.1e} |")
    return lines


def speed_table() -> list[str]:
    """Return what a reading costs: the probe alone, and over the wire through the real driver."""
    world = WorldSettings(part="block-c", seed=SEED)
    facts = facts_of(world)
    probe, clock = ProbeOverPart(world, facts), VirtualClock()
    x = np.linspace(5.0, 195.0, 400)
    spots = facts.part.surface(x, np.full(400, 50.0)) + 0.9 * facts.part.normal(x, np.full(400, 50.0))
    places = apply(facts.T_stage_part, spots)
    for place in places:
        probe.feel(place, FREQUENCY_HZ, 0.0)
    before = time.process_time()
    for place in places:
        probe.feel(place, FREQUENCY_HZ, 0.0)
    alone_ms = 1e3 * (time.process_time() - before) / len(places)
    meter = LcrSimulator(CoilAtStage(probe, lambda: places[7], clock), clock)
    host, port = meter.start()
    driver = KeysightE4980A(KeysightE4980ASettings(address=f"TCPIP::{host}::{port}::SOCKET"), clock)
    driver.configure(Drive(frequency_hz=FREQUENCY_HZ))
    before_cpu, before_wall = time.process_time(), time.perf_counter()
    for _ in range(2000):
        driver.read()
    cpu_ms, wall_s = 1e3 * (time.process_time() - before_cpu) / 2000, time.perf_counter() - before_wall
    driver.close()
    meter.close()
    return [
        "| one reading | CPU ms | wall |",
        "|---|---|---|",
        f"| true pose, closest point, impedance with slots | {alone_ms:.2f} | |",
        f"| the same through PyMeasure, pyvisa-py and TCP | {cpu_ms:.2f} | {2000 / wall_s:.0f} readings/s |",
    ]


def scan_table() -> list[str]:
    """Return what a stepped point costs with the real libraries at the cell's usual pace."""
    with open_rig(virtual_rig("block-a", SEED)) as rig:
        rig.stage.home()
        rig.instrument.configure(Drive(frequency_hz=FREQUENCY_HZ))
        T_stage_part, _ = rig.alignment()
        x = np.arange(5.0, 195.0, 5.0)
        part = facts_of(WorldSettings(part="block-a", seed=SEED)).part
        spots = part.surface(x, np.full(len(x), 50.0)) + 1.0 * part.normal(x, np.full(len(x), 50.0))
        places = apply(T_stage_part, spots)
        rig.stage.move(np.array([*places[0, :2], 38.0]))
        rig.stage.move(places[0])
        rig.instrument.read()
        path = [*places, *places[::-1]] * 2
        cpu, wall, cell = time.process_time(), time.perf_counter(), rig.clock.now()
        for place in path:
            rig.stage.move(place, 25.0)
            rig.clock.sleep(0.05)
            rig.instrument.read()
        count = len(path)
        cpu, wall = (time.process_time() - cpu) / count, (time.perf_counter() - wall) / count
        cell = (rig.clock.now() - cell) / count
    return [
        "| one point of 5 mm | CPU ms | wall ms | cell's time s | 800 points, wall s |",
        "|---|---|---|---|---|",
        f"| move at 25 mm/s, settle 0.05 s, read | {1e3 * cpu:.1f} | {1e3 * wall:.1f} | {cell:.2f} "
        f"| {800 * wall:.0f} |",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put the tables into docs/validation.md")
    arguments = parser.parse_args()
    body = "\n".join(
        [
            "`python -m benchmarks.virtual_cell --write`",
            "",
            f"Five views of each part, seed {SEED}, every sensor option at its default; error along the optical axis.",
            "",
            *camera_table(),
            "",
            "The coil's fast response against the exact integrals (3 mm pencil coil, 500 kHz, 19 MS/m).",
            "",
            *physics_table(),
            "",
            "Cost of a reading on block-c, one thread.",
            "",
            *speed_table(),
            "",
            "Cost of a stepped point: zaber-motion and PyMeasure against the simulators, all in one process.",
            "",
            *scan_table(),
        ]
    )
    print(body)
    if arguments.write:
        write_section("virtual-cell", "The virtual cell's devices", body)


if __name__ == "__main__":
    main()
