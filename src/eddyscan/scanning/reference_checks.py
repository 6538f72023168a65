"""Reference checks as ISO 15549 asks: warm-up, balance, a run over notches before and after, drift.

A check that fails marks everything since the last good one as not examined.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from eddyscan.core.errors import DeviceError, TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Clock, EddyInstrument, Stage
from eddyscan.physics.sound_response import (
    SoundResponse,
    coil_by_air_reading,
    sound_response,
    technique_coil,
    technique_conductor,
)
from eddyscan.scanning.field_motion import FieldProbe, approach

STEP_MM = 0.5
BESIDE_NOTCH_MM = 4.0
FAR_MM = 6.0
ABOVE_MM = 6.0
LARGEST_CHANGE = 0.10
LEAST_SNR = 6.0
WARM_STEP_S = 5.0
WARM_SHARE_PER_MINUTE = 2e-4
BALANCE_READS = 4


@dataclass(frozen=True)
class ReferenceBlock:
    """A flat block with notches across it, beside the part.

    Attributes
    ----------
    corner_mm : (3,) corner of its top [mm, stage], good to a few tenths
    length_mm, width_mm : float along x and y
    notch_x_mm : where the notches are, from the corner
    notch_depths_mm : their depths, in the same order
    number : str
        What is engraved on it.
    """

    corner_mm: tuple[float, float, float]
    length_mm: float
    width_mm: float
    notch_x_mm: tuple[float, ...]
    notch_depths_mm: tuple[float, ...]
    number: str = "not stated"

    def __post_init__(self) -> None:
        if len(self.notch_x_mm) != len(self.notch_depths_mm) or not self.notch_x_mm:
            raise TechniqueError(
                f"the reference block has {len(self.notch_x_mm)} notch places and {len(self.notch_depths_mm)} depths; "
                "give one place per depth."
            )

    @classmethod
    def evenly(
        cls,
        corner_mm: tuple[float, float, float],
        size_mm: tuple[float, float],
        notch_depths_mm: Sequence[float],
        number: str = "not stated",
    ) -> ReferenceBlock:
        """Return a block with notches evenly spread along x."""
        count = len(notch_depths_mm)
        places = tuple((k + 1) * size_mm[0] / (count + 1) for k in range(count))
        return cls(corner_mm, size_mm[0], size_mm[1], places, tuple(notch_depths_mm), number)


@dataclass(frozen=True)
class NotchResponse:
    """What one notch gave in one run; `as_dict` is an entry of the record's `references`."""

    when: str
    time_s: float
    notch_depth_mm: float
    amplitude_ohm: float
    phase_deg: float
    snr: float
    change: float | None = None
    passed: bool = True
    reason: str = ""


@dataclass(frozen=True)
class ReferenceRun:
    """One run over the block.

    Attributes
    ----------
    when : "before", "after" or a change's name
    time_s : float
    balance_ohm : complex [ohm] over sound metal at the run's lift-off
    lift_off_mm : float
    responses : tuple of NotchResponse
    """

    when: str
    time_s: float
    balance_ohm: complex
    lift_off_mm: float
    responses: tuple[NotchResponse, ...]

    @property
    def passed(self) -> bool:
        """Return whether every notch spoke as it should."""
        return all(response.passed for response in self.responses)

    def as_entries(self) -> list[dict[str, Any]]:
        """Return plain entries for the record's meta under `references`."""
        return [asdict(response) for response in self.responses]


def warm_up(
    probe: FieldProbe, *, longest_s: float = 1800.0, share_per_minute: float = WARM_SHARE_PER_MINUTE
) -> tuple[float, float]:
    """Read where the probe stands until the reading drifts slowly enough.

    Returns
    -------
    waited_s, drift_share_per_minute : float
        The latter relative to the reading.

    Raises
    ------
    DeviceError
        When it still drifts after `longest_s`.
    """
    began, earlier = probe.clock.now(), probe.read(BALANCE_READS)
    drift = float("inf")
    while probe.clock.now() - began < longest_s:
        then = probe.clock.now()
        probe.clock.sleep(WARM_STEP_S)
        now = probe.read(BALANCE_READS)
        drift = abs(now - earlier) / abs(now) * 60.0 / (probe.clock.now() - then)
        if drift <= share_per_minute * np.sqrt(60.0 / WARM_STEP_S):
            return probe.clock.now() - began, drift
        earlier = now
    raise DeviceError(
        f"the reading still drifts by {100 * drift:.3g} % per minute after {longest_s:.0f} s of warm-up "
        f"(limit {100 * share_per_minute:.3g} %). Check the cable and the coil's temperature."
    )


def run_reference(
    block: ReferenceBlock,
    technique: Technique,
    *,
    stage: Stage,
    instrument: EddyInstrument,
    clock: Clock,
    air_ohm: complex,
    when: str,
    progress: Progress = silent,
) -> ReferenceRun:
    """Run the coil along the block at the technique's lift-off and measure every notch.

    Parameters
    ----------
    block : ReferenceBlock
    technique : Technique
    stage, instrument, clock : the rig
    air_ohm : complex [ohm] reading in air
    when : str
        "before", "after", or what changed.

    Raises
    ------
    GeometryError
        No metal where the block should be.
    DeviceError
        From the devices; the probe is stopped and lifted first.
    """
    probe = FieldProbe(stage, instrument, clock, technique)
    instrument.configure(technique.drive)
    began = clock.now()
    try:
        response = _curve(technique, air_ohm)
        z, slope, balance = _levelled(probe, response, block)
        x = np.arange(2.0, block.length_mm - 2.0 + 1e-9, STEP_MM)
        heard = np.empty(len(x), dtype=np.complex128)
        for k, along in enumerate(x):
            probe.to(_over(block, float(along), z + slope * float(along)), slow=k == 0)
            heard[k] = probe.read()
            progress(f"reference block, {when}", k + 1, len(x))
        probe.lift()
    except BaseException:
        with contextlib.suppress(Exception):
            stage.stop()
        with contextlib.suppress(Exception):
            probe.lift()
        raise
    responses = tuple(
        _notch(x, heard, place, depth, when, began)
        for place, depth in zip(block.notch_x_mm, block.notch_depths_mm, strict=True)
    )
    return ReferenceRun(when, began, balance, technique.scan.lift_off_mm, responses)


def compared(before: ReferenceRun, after: ReferenceRun, *, largest_change: float = LARGEST_CHANGE) -> ReferenceRun:
    """Return the later run with every notch judged against the earlier one.

    A notch passes when its amplitude changed by at most `largest_change` and stands
    out of the noise.
    """
    judged = []
    for early, late in zip(before.responses, after.responses, strict=True):
        change = late.amplitude_ohm / early.amplitude_ohm - 1.0
        reasons = [late.reason] if late.reason else []
        if abs(change) > largest_change:
            reasons.append(f"amplitude changed by {100 * change:+.0f} % (limit {100 * largest_change:.0f} %)")
        values = asdict(late) | {"change": change, "passed": not reasons, "reason": "; ".join(reasons)}
        judged.append(NotchResponse(**values))
    return ReferenceRun(after.when, after.time_s, after.balance_ohm, after.lift_off_mm, tuple(judged))


def not_examined(runs: Sequence[ReferenceRun]) -> list[tuple[float, float]]:
    """Return the time spans [s] that count as not examined: from the last good run to each failed one."""
    spans, good = [], float("-inf")
    for run in sorted(runs, key=lambda one: one.time_s):
        if run.passed:
            good = run.time_s
        else:
            spans.append((good, run.time_s))
    return spans


def drift_ohm_per_hour(before: ReferenceRun, after: ReferenceRun) -> complex:
    """Return the drift of the balance between two runs [ohm/h]."""
    return (after.balance_ohm - before.balance_ohm) / (after.time_s - before.time_s) * 3600.0


def _curve(technique: Technique, air_ohm: complex) -> SoundResponse:
    frequency = technique.drive.frequency_hz
    coil = coil_by_air_reading(technique_coil(technique), air_ohm, frequency)
    return sound_response(coil, technique_conductor(technique), frequency, air_ohm=air_ohm, largest_lift_off_mm=FAR_MM)


def _levelled(probe: FieldProbe, response: SoundResponse, block: ReferenceBlock) -> tuple[float, float, complex]:
    """Return z at x = 0 [mm, stage] and its slope so that the coil keeps the technique's lift-off, and the balance."""
    wanted = probe.technique.scan.lift_off_mm
    ends = (2.0, block.length_mm - 2.0)
    heights = []
    for along in ends:
        over = _over(block, along, block.corner_mm[2])
        place, heard = approach(
            probe,
            response,
            over,
            start_mm=block.corner_mm[2] + ABOVE_MM,
            lowest_mm=max(block.corner_mm[2] - 2.0, float(probe.lower[2])),
            tilt_deg=0.0,
        )
        lift_off = float(response.project(np.array([heard]), np.zeros(1)).lift_off_mm[0])
        heights.append(float(place[2]) - lift_off + wanted)
    slope = (heights[1] - heights[0]) / (ends[1] - ends[0])
    z = heights[0] - slope * ends[0]
    probe.to(_over(block, ends[0], z + slope * ends[0] + ABOVE_MM), slow=False)
    probe.to(_over(block, ends[0], z + slope * ends[0]), slow=True)
    return z, slope, probe.read(BALANCE_READS)


def _over(block: ReferenceBlock, along_mm: float, z_mm: float) -> Array:
    return np.array([block.corner_mm[0] + along_mm, block.corner_mm[1] + block.width_mm / 2, z_mm])


def _notch(x: Array, heard: ComplexArray, place: float, depth: float, when: str, began_s: float) -> NotchResponse:
    """Return the largest change at a notch against the straight line through its surroundings."""
    near = np.abs(x - place) <= BESIDE_NOTCH_MM
    around = ~near & (np.abs(x - place) <= 2 * BESIDE_NOTCH_MM)
    line = np.polyfit(x[around], heard[around], 1)
    left = heard - np.polyval(line, x)
    noise = float(np.sqrt(np.mean(np.abs(left[around]) ** 2)))
    peak = complex(left[near][int(np.argmax(np.abs(left[near])))])
    snr = abs(peak) / max(noise, 1e-12)
    reason = "" if snr >= LEAST_SNR else f"signal to noise {snr:.1f} (least {LEAST_SNR:.0f})"
    return NotchResponse(
        when, began_s, depth, abs(peak), float(np.degrees(np.angle(peak))), snr, None, not reason, reason
    )
