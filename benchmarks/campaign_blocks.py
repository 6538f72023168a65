"""Records of 1e5 readings and more, made and analysed piece by piece: time and memory against size."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from eddyscan.campaign.blocks import analyse_in_blocks
from eddyscan.campaign.signal_case import flat_mesh
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique
from eddyscan.physics import Conductor, air_inductance_h, impedance_ohm
from eddyscan.physics.sound_response import technique_coil

STEP_MM, MESH_MM = 0.5, 2.0
PER_PIECE = 100_000
WIDEST = 316  # readings in a row: the overlap weighs the same at every size


def block_rows(counts: Sequence[int]) -> list[list[str]]:
    """Return one table row per number of readings: pieces, CPU s, microseconds per reading, peak memory."""
    rows = []
    for count in counts:
        technique = _technique()
        wide = min(WIDEST, round(count**0.5))
        high = -(-count // wide)
        mesh = flat_mesh((wide - 1) * STEP_MM, (high - 1) * STEP_MM, MESH_MM)
        began = time.process_time()
        result = analyse_in_blocks(_pieces(technique, wide, high), mesh, technique)
        cpu = time.process_time() - began
        peak_gb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
        each = f"{1e6 * cpu / result.readings:.1f}"
        rows.append([f"{result.readings:.2e}", str(result.pieces), f"{cpu:.1f}", each, f"{peak_gb:.2f}"])
        print(rows[-1], flush=True)
    return rows


def _technique() -> Technique:
    base = Technique()
    raster = {"pitch_mm": STEP_MM, "step_mm": STEP_MM, "machine": "pose"}
    return base.model_copy(update={"plan": base.plan.model_copy(update=raster)})


def _pieces(technique: Technique, wide: int, high: int) -> Iterator[ScanRecord]:
    coil, frequency = technique_coil(technique), technique.drive.frequency_hz
    conductor = Conductor.half_space(technique.part.conductivity_ms_m)
    nominal = technique.scan.lift_off_mm
    knots = np.linspace(0.7 * nominal, 1.3 * nominal, 61)
    sound = CubicSpline(knots, impedance_ohm(coil, conductor, frequency, knots))
    reactance = 2 * np.pi * frequency * air_inductance_h(coil)
    rows = max(1, PER_PIECE // wide)
    for start in range(0, high, rows):
        row = np.repeat(np.arange(start, min(high, start + rows)), wide)
        draw, n = np.random.default_rng(start), len(row)
        point = np.arange(n) % wide
        height = nominal * (1 + 0.1 * np.sin(point * 0.02) * np.cos(row * 0.03))
        noise = draw.standard_normal((2, n)) * 1e-4 * reactance / np.sqrt(2)
        place = np.stack([point * STEP_MM, row * STEP_MM, height], axis=1)
        yield ScanRecord(
            row=row,
            point=point,
            time_s=(row * wide + point) * 1e-3,
            stage_mm=place,
            target_mm=place,
            frequency_hz=np.full(n, frequency),
            impedance_ohm=np.asarray(sound(height)) + noise[0] + 1j * noise[1],
            flag=np.zeros(n, dtype=np.int64),
            meta={"T_stage_part": np.eye(4).tolist(), "air": [0.0, reactance]},
        )
