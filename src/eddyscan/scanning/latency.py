"""How late a reading is against the measured positions, found on a line run both ways.

The instrument stamps a reading when it has it, the stage a position at the
middle of its round trip; the difference of their delays moves every reading of
a moving scan along its row. On a line driven both ways the delay shifts the
signal in opposite directions. The line is the approach itself, straight up from
the part and down again: there every part gives contrast, a flat one too.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.optimize import least_squares

from eddyscan.core.errors import WorkError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.devices.protocols import PathStage, TimedPath
from eddyscan.scanning.trajectory import row_path

if TYPE_CHECKING:
    from eddyscan.scanning.running import Scan

LINE_MM = 2.0
LARGEST_S = 0.15
LARGEST_UNCERTAINTY_S = 0.004
DEGREE = 6
TRIAL_S, TRIAL_MM = 2e-4, 2e-4
LEAST_EXPLAINED = 0.3  # a curve that leaves more of the signal's variation unexplained is no curve
SPEED_SHARES = (1.0, 0.4)  # two speeds tell a delay from backlash
DIRECTION_S = 0.01


@dataclass(frozen=True)
class Latency:
    """Delay of readings against positions and its standard uncertainty [s], backlash found besides [mm]."""

    seconds: float
    uncertainty_s: float
    backlash_mm: float
    readings: int


def measure_latency(scan: Scan, mode: str) -> Latency:
    """Run a line up and down from where the probe stands over the part and fit the delay; noted in the record."""
    here = scan.stage.position()
    upper = here.copy()
    upper[2] = min(here[2] + LINE_MM, scan.stage.axes()[2].upper)
    times: list[float] = []
    values: list[complex] = []
    looks: list[tuple[float, float]] = []
    for share in SPEED_SHARES:
        speed = share * scan.technique.scan.approach_speed_mm_s
        for start, end in ((here, upper), (upper, here)):
            path = row_path(np.array([start, end]), speed, scan.stage.axes()).path
            _drive_line(scan, mode, path, (times, values, looks))
    t, z = np.array([look[0] for look in looks]), np.array([look[1] for look in looks])
    latency = fit_latency(np.array(times), np.array(values), t, z)
    if not latency.uncertainty_s <= LARGEST_UNCERTAINTY_S:
        raise WorkError(
            f"the delay between readings and positions came out as {1e3 * latency.seconds:.1f} ms with an uncertainty "
            f"of {1e3 * latency.uncertainty_s:.1f} ms (limit {1e3 * LARGEST_UNCERTAINTY_S:.0f}) from "
            f"{latency.readings} readings above the row's first point. Check that the probe reads the part "
            "there, or set scan.mode to step."
        )
    scan.sink.note("latency", {**asdict(latency), "mode": mode})
    return latency


Heard = tuple[list[float], list[complex], list[tuple[float, float]]]


def _drive_line(scan: Scan, mode: str, path: TimedPath, heard: Heard) -> None:
    times, values, looks = heard
    stage = cast(PathStage, scan.stage)
    looks.append((scan.clock.now(), float(path.position[0, 2])))
    stage.start_path(path, mode)
    moving = True
    while moving:
        reading = scan.instrument.read()
        sample = stage.follow_path()
        moving = sample.moving
        looks.append((float(sample.time_s[2]), float(sample.position[2])))
        times.append(reading.time_s)
        values.append(reading.impedance_ohm)


def fit_latency(times_s: Array, values: ComplexArray, position_times_s: Array, positions: Array) -> Latency:
    """Find the delay that makes one smooth curve of signal over position from lines driven both ways.

    Parameters
    ----------
    times_s, values : (N,) readings: stamps [s] and complex values
    position_times_s, positions : (M,) measured positions along the line [mm] and their stamps [s]

    Returns
    -------
    Latency
        Least squares over delay and backlash together: the delay shifts the
        signal by speed x delay, backlash by half of it at any speed, so lines
        at two speeds tell them apart. For every trial the signal over position
        is a polynomial fitted anew. Uncertainty: from the Jacobian and the
        scatter that is left.
    """
    unit = np.max(np.abs(values - values.mean())) or 1.0
    parts = np.stack([values.real, values.imag], axis=1) / unit

    def misfit(unknown: Array) -> Array:
        when = times_s - unknown[0]
        where = np.interp(when, position_times_s, positions)
        before = np.interp(when - DIRECTION_S, position_times_s, positions)
        where = where - 0.5 * unknown[1] * np.sign(where - before)
        x = np.clip(2 * (where - positions.min()) / max(float(np.ptp(positions)), 1e-9) - 1, -1.1, 1.1)
        basis = np.polynomial.chebyshev.chebvander(x, DEGREE)
        return np.asarray((parts - basis @ np.linalg.lstsq(basis, parts, rcond=None)[0]).ravel())

    coarse = np.linspace(-LARGEST_S, LARGEST_S, 61)
    best = float(coarse[int(np.argmin([(misfit(np.array([d, 0.0])) ** 2).sum() for d in coarse]))])

    def slopes(unknown: Array) -> Array:
        steps = np.diag([TRIAL_S, TRIAL_MM])
        return np.stack([(misfit(unknown + h) - misfit(unknown - h)) / (2 * h.sum()) for h in steps], axis=1)

    found = least_squares(misfit, [best, 0.0], jac=slopes, x_scale=[1e-3, 1e-3])
    jacobian = np.asarray(found.jac)
    spread = found.fun.size - 2 * (DEGREE + 1) - 2
    information = np.asarray(jacobian.T @ jacobian)
    left = float((found.fun**2).sum())
    varied = float(((parts - parts.mean(axis=0)) ** 2).sum())
    if spread <= 0 or left > LEAST_EXPLAINED * varied or np.linalg.det(information) <= 0:
        return Latency(float(found.x[0]), float("inf"), 0.0, len(times_s))
    covariance = np.linalg.inv(information) * left / spread
    return Latency(float(found.x[0]), float(np.sqrt(covariance[0, 0])), float(found.x[1]), len(times_s))
