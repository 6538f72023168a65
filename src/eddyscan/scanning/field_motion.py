"""Slow ways towards metal: down to the surface and out over its rim, guided by the coil's own reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.technique import Technique
from eddyscan.devices.protocols import Clock, EddyInstrument, Stage
from eddyscan.physics.sound_response import SoundResponse

BLIND_STEP_MM = 2.0
SHARE_OF_GAP = 0.85
TARGET_MM = 0.9
NEAR_ENOUGH_MM = 0.25
READS = 3
NOISE_SHARE = 1e-4
DETECTED = 15.0
SEARCH_STEP_MM = 2.0
FINE_STEP_MM = 0.5
HALF = 0.5
FAST_SHARE = 0.9


@dataclass
class FieldProbe:
    """The probe, the stage that carries it and the coil's curve."""

    stage: Stage
    instrument: EddyInstrument
    clock: Clock
    technique: Technique

    def __post_init__(self) -> None:
        axes = self.stage.axes()[:3]
        self.lower = np.array([axis.lower for axis in axes])
        self.upper = np.array([axis.upper for axis in axes])
        self.fast_mm_s = FAST_SHARE * min(axis.max_speed for axis in axes)

    def read(self, count: int = 1) -> complex:
        """Return the mean of `count` readings [ohm] after settling."""
        self.clock.sleep(self.technique.scan.settle_s)
        heard = [self.instrument.read() for _ in range(count)]
        bad = [reading.flag for reading in heard if reading.flag]
        if bad:
            raise GeometryError(
                f"the instrument flagged {len(bad)} of {count} readings (flag {bad[0]}) while looking for the part at "
                f"{np.round(self.stage.position()[:3], 2).tolist()} mm (stage). Check coil, cable and range."
            )
        return complex(np.mean([reading.impedance_ohm for reading in heard]))

    def reachable(self, stage_mm: Array) -> bool:
        """Return whether a position lies inside the axis travels."""
        return bool(np.all(stage_mm >= self.lower) and np.all(stage_mm <= self.upper))

    def to(self, stage_mm: Array, *, slow: bool) -> None:
        """Move there."""
        self.stage.move(stage_mm, self.technique.scan.approach_speed_mm_s if slow else self.fast_mm_s)

    def lift(self) -> None:
        """Go straight up to the end of the travel."""
        here = self.stage.position()[:3]
        self.to(np.array([here[0], here[1], self.upper[2]]), slow=False)

    def rise_and_cross(self, stage_mm: Array, height_mm: float) -> None:
        """Go up to a height, across, and stay there."""
        here = self.stage.position()[:3]
        height = float(np.clip(height_mm, self.lower[2], self.upper[2]))
        if here[2] < height:
            self.to(np.array([here[0], here[1], height]), slow=False)
        self.to(np.array([stage_mm[0], stage_mm[1], max(height, float(here[2]))]), slow=False)


def approach(
    probe: FieldProbe, response: SoundResponse, over_mm: Array, *, start_mm: float, lowest_mm: float, tilt_deg: float
) -> tuple[Array, complex]:
    """Come down over a spot until the coil reads about 0.9 mm of lift-off, without contact.

    Parameters
    ----------
    probe : FieldProbe
    response : SoundResponse
    over_mm : (3,) spot on the believed surface [mm, stage]
    start_mm, lowest_mm : float [mm, stage] z to begin at and never to go below
    tilt_deg : float [deg] believed tilt there

    Returns
    -------
    stage_mm : (3,) measured position [mm, stage]
    impedance_ohm : complex [ohm], mean of four readings

    Raises
    ------
    GeometryError
        When no metal is met above `lowest_mm`.
    """
    z = float(min(start_mm, probe.upper[2]))
    probe.rise_and_cross(over_mm, z)
    tilt = np.array([min(tilt_deg, response.largest_tilt_deg)])
    rim = float(response.rim_mm(tilt)[0])
    while True:
        probe.to(np.array([over_mm[0], over_mm[1], z]), slow=True)
        gap = lift_off_now(response, probe.read(), tilt)
        to_go = BLIND_STEP_MM if np.isnan(gap) else min(SHARE_OF_GAP * (gap - TARGET_MM - rim), BLIND_STEP_MM)
        if not np.isnan(gap) and gap - TARGET_MM - rim < NEAR_ENOUGH_MM:
            break
        if z <= lowest_mm:
            raise GeometryError(
                f"no metal under x = {over_mm[0]:.1f}, y = {over_mm[1]:.1f} mm (stage) down to z = {lowest_mm:.1f} mm; "
                f"the rough corner says it is at {over_mm[2]:.1f} mm. Jog to the part's corner again."
            )
        z = max(z - to_go, lowest_mm)
    return probe.stage.position()[:3].copy(), probe.read(READS)


def climb(probe: FieldProbe, bottom_mm: Array, rise_mm: Array) -> tuple[Array, ComplexArray]:
    """Read at heights above a spot: returns measured z (K,) [mm, stage] and readings (K,) [ohm]."""
    z, heard = [], []
    for rise in rise_mm:
        probe.to(np.array([bottom_mm[0], bottom_mm[1], bottom_mm[2] + rise]), slow=True)
        heard.append(probe.read(READS))
        z.append(float(probe.stage.position()[2]))
    return np.array(z), np.array(heard)


def lift_off_now(response: SoundResponse, impedance_ohm: complex, tilt_deg: Array) -> float:
    """Return the lift-off [mm], NaN when the metal is too far to tell."""
    if abs(impedance_ohm - response.air_ohm) < DETECTED * NOISE_SHARE * abs(response.air_ohm.imag):
        return float("nan")
    return float(response.project(np.array([impedance_ohm]), tilt_deg).lift_off_mm[0])


def cross_rim(
    probe: FieldProbe, air_ohm: complex, path: Callable[[float], Array], *, inside_mm: float, outside_mm: float
) -> Array | None:
    """Move out over the rim at constant height and return where the reading has fallen to a half.

    Parameters
    ----------
    path : callable
        Distance inside the believed rim [mm] -> coil position (3,) [mm, stage].
    inside_mm, outside_mm : float [mm]
        Where to begin, and how far beyond the believed rim to look.

    Returns
    -------
    crossing : (3,) [mm, stage], or None when the search left the travel or the reading never fell
    """
    s = inside_mm
    if not probe.reachable(path(s)):
        return None
    probe.rise_and_cross(path(s), float(path(s)[2]) + 2.0)
    probe.to(path(s), slow=True)
    strength, place = [abs(probe.read(2) - air_ohm)], [probe.stage.position()[:3].copy()]
    while strength[-1] > HALF * strength[0]:
        s -= SEARCH_STEP_MM if strength[-1] > 0.9 * strength[0] else FINE_STEP_MM
        if s < -outside_mm or not probe.reachable(path(s)):
            return None
        probe.to(path(s), slow=False)
        strength.append(abs(probe.read(2) - air_ohm))
        place.append(probe.stage.position()[:3].copy())
    upper, lower = strength[-2], strength[-1]
    share = (upper - HALF * strength[0]) / (upper - lower)
    return np.asarray(place[-2] * (1 - share) + place[-1] * share)
