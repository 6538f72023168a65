"""From the record of a scan to signals on the surface and indications."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from eddyscan.analysis.background import (
    explained,
    robust_sigma,
    slow_along_rows,
    slow_over_surface,
)
from eddyscan.analysis.correction import corrected_surface
from eddyscan.analysis.detection import match_cracks
from eddyscan.analysis.gap_field import gap_field
from eddyscan.analysis.indications import Signals, find_indications
from eddyscan.analysis.mapping import map_to_surface
from eddyscan.analysis.readings import Readings, usable
from eddyscan.analysis.result import AnalysisResult
from eddyscan.analysis.sensitivity import SENSITIVE, relative_sensitivity
from eddyscan.core.footing import Footing, footing
from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.progress import Progress, silent
from eddyscan.core.record import ScanRecord
from eddyscan.core.rim import edge_zone_mm, rim_of
from eddyscan.core.technique import Technique
from eddyscan.physics import Conductor
from eddyscan.physics.sound_response import (
    Projection,
    SoundResponse,
    coil_by_air_reading,
    curvature_gap_mm,
    sound_response,
    technique_coil,
    technique_conductor,
)

SLOW_WINDOW_IN_DIAMETERS = 8.0
LEAST_FOR_SURFACE = 50
EXTRAPOLATED_MM = 8.0
WIRE_SAMPLES = 2000
WIRE_ROUNDS = 5


def analyse(
    record: ScanRecord, mesh: SurfaceMesh, technique: Technique, *, progress: Progress = silent
) -> AnalysisResult:
    """Turn a record into lift-off, residual, C-scan and indications.

    Parameters
    ----------
    record : ScanRecord
        Raw readings; never changed. `meta` needs `T_stage_part` and should hold `air`.
    mesh : SurfaceMesh [mm, part]
    technique : Technique
    progress : Progress

    Returns
    -------
    AnalysisResult
        Channels of its C-scan: "lift_off_mm" (coil to surface), "amplitude_ohm" (change
        against air), "residual_ohm" (size of what sound metal does not explain),
        "score" (matched residual over its noise), "sensitivity" (response to a small
        crack at this lift-off over that at the technique's).

    Raises
    ------
    InputError
        Empty record, too few unflagged readings, another frequency.
    GeometryError
        The readings lie nowhere near the surface.
    """
    progress("readings", 0, 4)
    readings = usable(record, technique.drive.frequency_hz)
    below = footing(mesh, readings.part_mm, axis=probe_axis(readings, technique))
    progress("lift-off", 1, 4)
    response = response_for(technique, readings, tilt_deg=below.tilt_deg)
    below, projection, lift_off = read_lift_off(readings, below, response, mesh, technique)
    progress("residual", 2, 4)
    across = crack_channel(readings, below, projection, technique)
    signals = _signals(readings, below, projection, across, response, technique, mesh)
    progress("indications", 3, 4)
    found = find_indications(
        signals, threshold=technique.analysis.threshold_mad, merge_mm=2 * technique.probe.outer_radius_mm
    )
    amplitude = np.abs(readings.impedance_ohm - response.air_ohm)
    sensitivity = relative_sensitivity(response, lift_off, nominal_mm=technique.scan.lift_off_mm)
    channels = {"lift_off_mm": lift_off, "amplitude_ohm": amplitude, "sensitivity": sensitivity}
    cscan = _cscan(mesh, below, channels, signals, technique)
    statistics = _statistics(record, readings, lift_off, signals, cscan.covered, response)
    statistics |= {
        "sensitive_share": float((cscan.covered & (cscan.channels["sensitivity"] >= SENSITIVE)).mean()),
        "false_call_basis": f"matched residual above {technique.analysis.threshold_mad:g} robust standard deviations",
        "air_reading": "estimated from the scan" if readings.air_ohm is None else "measured",
        "coil": "calibrated" if readings.coil is not None else "by its air reading" if readings.air_ohm else "as drawn",
    }
    progress("indications", 4, 4)
    n = len(record)
    return AnalysisResult(
        cscan,
        found,
        _spread(lift_off, readings, n),
        _spread(signals.residual_ohm, readings, n),
        statistics,
        _spread(below.foot_mm, readings, n),
        _spread(signals.score, readings, n),
    )


def probe_axis(readings: Readings, technique: Technique) -> Array | None:
    """Return the probe's fixed direction, or None when the machine keeps it on the normal."""
    return readings.axis if technique.plan.machine == "xyz" else None


def response_for(technique: Technique, readings: Readings, *, tilt_deg: Array) -> SoundResponse:
    """Return the sound part's curve: the coil as calibrated, else by its air reading, else as drawn."""
    coil, air, largest_tilt_deg = technique_coil(technique), readings.air_ohm, float(tilt_deg.max())
    if readings.coil is not None:
        coil = readings.coil
    elif air is not None:
        coil = coil_by_air_reading(coil, air, technique.drive.frequency_hz)
    conductor = technique_conductor(technique)
    if readings.conductivity_ms_m is not None:
        conductor = Conductor.half_space(readings.conductivity_ms_m)

    def curve(air_ohm: complex | None) -> SoundResponse:
        return sound_response(
            coil,
            conductor,
            technique.drive.frequency_hz,
            air_ohm=air_ohm,
            largest_lift_off_mm=2.0 * technique.analysis.lift_off_max_mm + 1.0,
            largest_tilt_deg=largest_tilt_deg,
        )

    return curve(air) if air is not None else _with_wire(curve, readings, tilt_deg)


def _with_wire(curve: Callable[[complex | None], SoundResponse], readings: Readings, tilt_deg: Array) -> SoundResponse:
    """Return the curve with the wire's resistance that lays most readings on it, for records without an air reading."""
    some = slice(None, None, max(1, len(readings) // WIRE_SAMPLES))
    reactance = curve(None).reactance_air_ohm

    def beside(wire_ohm: float) -> float:
        projection = curve(complex(wire_ohm, reactance)).project(readings.impedance_ohm[some], tilt_deg[some])
        return float(np.nanmedian(projection.across_ohm))

    low, high = 0.0, 0.05 * reactance
    left, right = beside(low), beside(high)
    for _ in range(WIRE_ROUNDS):
        if abs(right - left) < 1e-12:
            break
        low, high, left = high, high - right * (high - low) / (right - left), right
        right = beside(high)
    return curve(complex(high, reactance))


def read_lift_off(
    readings: Readings, below: Footing, response: SoundResponse, mesh: SurfaceMesh, technique: Technique
) -> tuple[Footing, Projection, Array]:
    """Return the surface below the readings as the probe found it, their projection, and lift-off (M,) [mm].

    The camera's slopes are off by tenths of a degree, which a tilted coil reads as
    a false residual. Lift-off and position together tell the true surface, so the
    tilt comes from there, in a second round.
    """
    axis = probe_axis(readings, technique)
    projection = response.project(readings.impedance_ohm, below.tilt_deg)
    lift_off = _without_curvature(projection, below, response)
    known = np.isfinite(lift_off)
    if axis is not None and known.sum() >= LEAST_FOR_SURFACE:
        field = gap_field(
            below.foot_mm[known],
            below.normal[known],
            lift_off[known] - below.distance_mm[known],
            least_width_mm=technique.probe.outer_radius_mm,
        )
        below = footing(corrected_surface(mesh, field, reach_mm=EXTRAPOLATED_MM), readings.part_mm, axis=axis)
        projection = response.project(readings.impedance_ohm, below.tilt_deg)
        lift_off = _without_curvature(projection, below, response)
    return below, projection, lift_off


def _without_curvature(projection: Projection, below: Footing, response: SoundResponse) -> Array:
    return np.asarray(
        projection.lift_off_mm - curvature_gap_mm(response.coil, projection.lift_off_mm, below.curvature_per_mm)
    )


def crack_channel(readings: Readings, below: Footing, projection: Projection, technique: Technique) -> Array:
    """Return the signed residual across the lift-off curve, slow changes taken out (M,) [ohm]."""
    across = projection.across_ohm
    h, tilt = projection.lift_off_mm, np.radians(below.tilt_deg)
    causes = np.column_stack([h, h**2, h**3, tilt, tilt**2, below.curvature_per_mm, readings.time_s])
    left = across - explained(across, causes)
    window = SLOW_WINDOW_IN_DIAMETERS * 2 * technique.probe.outer_radius_mm
    left = left - slow_along_rows(left, readings.row, readings.part_mm, window_mm=window)
    diameter = 2 * technique.probe.outer_radius_mm
    shared = slow_over_surface(left, below.foot_mm, cell_mm=0.6 * diameter, radius_mm=2.2 * diameter)
    return np.asarray(left - shared)


def _signals(
    readings: Readings,
    below: Footing,
    projection: Projection,
    across: Array,
    response: SoundResponse,
    technique: Technique,
    mesh: SurfaceMesh,
) -> Signals:
    probe = technique.probe
    falling = -projection.tangent_ohm_mm / np.abs(projection.tangent_ohm_mm)
    match = match_cracks(
        across,
        below.foot_mm,
        below.normal,
        response,
        lift_off_mm=float(np.nanmedian(projection.lift_off_mm)),
    )
    near = np.nan_to_num(projection.lift_off_mm, nan=np.inf) <= technique.analysis.lift_off_max_mm
    inside = rim_of(mesh).distance_mm(below.foot_mm) > edge_zone_mm(probe.outer_radius_mm)
    return Signals(
        below.foot_mm,
        below.normal,
        readings.row,
        1j * across * falling,
        match.score,
        match.whole,
        near & inside,
        robust_sigma(across),
    )


def _cscan(
    mesh: SurfaceMesh, below: Footing, channels: dict[str, Array], signals: Signals, technique: Technique
) -> Any:
    reach = 0.55 * float(np.hypot(technique.plan.pitch_mm, technique.plan.step_mm))
    values = {**channels, "residual_ohm": signals.residual_ohm, "score": signals.score}
    reach = max(reach, technique.probe.outer_radius_mm)
    return map_to_surface(mesh, below.foot_mm, values, reach_mm=reach, speaks=signals.callable)


def _statistics(
    record: ScanRecord,
    readings: Readings,
    lift_off: Array,
    signals: Signals,
    covered: BoolArray,
    response: SoundResponse,
) -> dict[str, Any]:
    known = lift_off[np.isfinite(lift_off)]
    spread = {f"p{p:02d}": float(np.percentile(known, p)) if known.size else None for p in (5, 50, 95)}
    return {
        "readings": len(record),
        "readings_used": len(readings),
        "readings_flagged": int((record.flag != 0).sum()),
        "readings_too_far": int(np.isnan(lift_off).sum()),
        "lift_off_mm": {"mean": float(known.mean()) if known.size else None, **spread},
        "residual_noise_ohm": signals.noise_ohm,
        "residual_noise_share_of_x0": signals.noise_ohm / abs(response.air_ohm.imag),
        "reactance_air_ohm": float(response.air_ohm.imag),
        "covered_share": float(covered.mean()),
    }


def _spread(values: Any, readings: Readings, n: int) -> Any:
    full = np.full((n, *values.shape[1:]), np.nan, dtype=values.dtype)
    full[readings.index] = values
    return full
