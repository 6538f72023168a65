"""Made-up scans with known truth: a coil over a named part, signals from the physics room alone."""

from __future__ import annotations

import numpy as np

from eddyscan import physics
from eddyscan.core.frames import Array, apply, invert, transform
from eddyscan.core.parts import NominalPart, named_part
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique

WIRE_OHM = 1.7


def technique(**sections: dict[str, object]) -> Technique:
    """Build a technique from changed sections."""
    return Technique.model_validate({name: dict(values) for name, values in sections.items()})


def true_coil(tech: Technique, scale: float = 1.0) -> physics.Coil:
    """Return the technique's coil with its winding scaled."""
    p = tech.probe
    return physics.Coil(p.inner_radius_mm * scale, p.outer_radius_mm * scale, p.length_mm * scale, p.turns)


def air_ohm(tech: Technique, scale: float = 1.0) -> complex:
    """Return what the coil reads in air: wire resistance and its reactance."""
    x0 = 2 * np.pi * tech.drive.frequency_hz * physics.air_inductance_h(true_coil(tech, scale))
    return complex(WIRE_OHM, x0)


def sound_ohm(tech: Technique, lift_off_mm: Array, tilt_deg: Array, scale: float = 1.0) -> Array:
    """Return readings over sound metal, tilt in exact steps of a quarter degree interpolated linearly."""
    coil, metal = true_coil(tech, scale), physics.Conductor.half_space(tech.part.conductivity_ms_m)
    lower = np.floor(tilt_deg * 4) / 4
    out = np.zeros(len(lift_off_mm), dtype=complex)
    for step in np.unique(lower):
        at = lower == step
        share = (tilt_deg[at] - step) * 4
        ends = [
            physics.impedance_ohm(coil, metal, tech.drive.frequency_hz, lift_off_mm[at], tilt_deg=t)
            for t in ((step, step + 0.25) if share.any() else (step, step))
        ]
        out[at] = ends[0] * (1 - share) + ends[1] * share
    return out + WIRE_OHM


def grid_record(
    tech: Technique,
    part: NominalPart | str = "block-a",
    *,
    window: tuple[float, float, float, float] = (40.0, 120.0, 30.0, 60.0),
    lift_off_error: object = None,
    noise: float = 1e-4,
    T_stage_part: Array | None = None,
    seed: int = 1,
    scale: float = 1.0,
) -> tuple[ScanRecord, Array]:
    """Scan a window (x from, to, y from, to) of a part; return the record and the true lift-off (N,)."""
    shape = named_part(part) if isinstance(part, str) else part
    rng = np.random.default_rng(seed)
    x = np.arange(window[0], window[1], tech.plan.step_mm)
    y = np.arange(window[2], window[3], tech.plan.pitch_mm)
    u = np.concatenate([x if k % 2 == 0 else x[::-1] for k in range(len(y))])
    row = np.repeat(np.arange(len(y)), len(x))
    v = y[row]
    normal = shape.normal(u, v)
    lift_off = np.full(len(u), tech.scan.lift_off_mm)
    if lift_off_error is not None:
        lift_off = lift_off + lift_off_error(u, v)  # type: ignore[operator]
    vertical = tech.plan.machine == "xyz"
    tilt = np.degrees(np.arccos(np.clip(normal[:, 2], -1, 1))) if vertical else np.zeros(len(u))
    signal = sound_ohm(tech, lift_off, tilt, scale)
    air = air_ohm(tech, scale)
    signal = signal + noise * air.imag * (rng.standard_normal(len(u)) + 1j * rng.standard_normal(len(u)))
    T = transform() if T_stage_part is None else T_stage_part
    stage = apply(T, shape.surface(u, v) + lift_off[:, None] * normal)
    n = len(u)
    return (
        ScanRecord(
            row,
            np.tile(np.arange(len(x)), len(y)),
            np.arange(n) * 0.02,
            stage,
            stage.copy(),
            np.full(n, tech.drive.frequency_hz),
            signal,
            np.zeros(n, dtype=np.int64),
            {"T_stage_part": T.tolist(), "air": [air.real, air.imag]},
        ),
        lift_off,
    )


def inverse(T: Array) -> Array:
    """Return the inverse transform."""
    return invert(T)
