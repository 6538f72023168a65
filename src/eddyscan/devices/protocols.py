"""What eddyscan asks of a device: small protocols, no base class, no registry.

`rig.toml` names ``module:Class``, so a lab's own driver works from its own
package. A driver is synchronous and has one owner; `stop()` alone may be
called from any thread, at any time, more than once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from eddyscan.core.depth import DepthImage
from eddyscan.core.frames import Array
from eddyscan.core.record import Reading
from eddyscan.core.technique import Drive


@dataclass(frozen=True)
class Identity:
    """Who answered: stored with every scan."""

    kind: str
    model: str
    serial: str
    firmware: str = ""
    verified: bool = False
    settings: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Axis:
    """One axis as it reported itself at connect [mm or deg]."""

    name: str
    lower: float
    upper: float
    resolution: float
    max_speed: float
    acceleration: float
    unit: str = "mm"


@dataclass(frozen=True)
class ImpedanceReading:
    """What an instrument returned: impedance [ohm], time [s of the rig's clock], flag bits."""

    impedance_ohm: complex
    time_s: float
    flag: int = 0


@runtime_checkable
class Clock(Protocol):
    """The only source of time; may run faster than the wall clock."""

    def now(self) -> float:
        """Return seconds; only differences count."""

    def sleep(self, seconds: float) -> None:
        """Wait `seconds` of this clock."""


@runtime_checkable
class DepthCamera(Protocol):
    """Takes depth images."""

    def identity(self) -> Identity: ...

    def capture(self) -> DepthImage:
        """Take one view from where the camera (or the part) is now."""

    def close(self) -> None: ...


@runtime_checkable
class Stage(Protocol):
    """Moves the probe relative to the part; axes in the order x, y, z (then rotary axes)."""

    def identity(self) -> Identity: ...

    def axes(self) -> Sequence[Axis]: ...

    def home(self) -> None:
        """Reference every axis: z (away from the part) first."""

    def is_homed(self) -> bool: ...

    def move(self, target: Array, speed: float | None = None) -> None:
        """Move all axes to `target` [axis units], arrive together, verify, return.

        Raises TravelError before anything moves, MotionError on stall or a missed
        target, LinkError when the stage does not answer.
        """

    def position(self) -> Array:
        """Return measured positions (n_axes,) [axis units]."""

    def stop(self) -> None:
        """Stop every axis now."""

    def close(self) -> None: ...


@dataclass(frozen=True)
class TimedPath:
    """Axis positions and velocities at times, joined by cubics.

    Attributes
    ----------
    time_s : (N,) rising from 0
    position : (N, n_axes) [axis units]
    velocity : (N, n_axes) [axis units per s]; zero at both ends
    """

    time_s: Array
    position: Array
    velocity: Array

    @property
    def duration_s(self) -> float:
        """Return the time of the last point [s]."""
        return float(self.time_s[-1])

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Return (position, velocity) (n_axes,) at a time; at rest before the start and after the end."""
        t = min(max(time_s, 0.0), self.duration_s)
        i = min(max(int(np.searchsorted(self.time_s, t, side="right")) - 1, 0), len(self.time_s) - 2)
        span = float(self.time_s[i + 1] - self.time_s[i])
        u = (t - float(self.time_s[i])) / span
        p0, p1 = self.position[i], self.position[i + 1]
        v0, v1 = self.velocity[i] * span, self.velocity[i + 1] * span
        c2, c3 = 3 * (p1 - p0) - 2 * v0 - v1, v0 + v1 - 2 * (p1 - p0)
        moving = 0.0 <= time_s <= self.duration_s
        velocity = (v0 + u * (2 * c2 + u * 3 * c3)) / span if moving else np.zeros_like(p0)
        return p0 + u * (v0 + u * (c2 + u * c3)), velocity


@dataclass(frozen=True)
class PathSample:
    """One look at a stage on its path.

    Attributes
    ----------
    time_s : (n_axes,) when each axis was read [s of the rig's clock]
    position : (n_axes,) measured [axis units]
    moving : False once every axis rests at the end of the path
    """

    time_s: Array
    position: Array
    moving: bool


@runtime_checkable
class PathStage(Protocol):
    """A stage that follows timed paths besides moving from point to point."""

    def path_modes(self) -> tuple[str, ...]:
        """Return what it can follow: "row" (one axis after the other), "pvt" (timed points on one controller)."""

    def start_path(self, path: TimedPath, mode: str) -> float:
        """Begin a path at whose start the stage stands; return its time zero [s of the rig's clock].

        Raises TravelError before anything moves, MotionError when it stands elsewhere.
        """

    def follow_path(self) -> PathSample:
        """Read the axes and keep them on the path; call it at least every 50 ms until nothing moves.

        A stage that is no longer called comes to rest by itself within half a second.
        """


@runtime_checkable
class EddyInstrument(Protocol):
    """Reads complex impedance."""

    def identity(self) -> Identity: ...

    def configure(self, drive: Drive) -> None: ...

    def read(self) -> ImpedanceReading: ...

    def close(self) -> None: ...


@runtime_checkable
class RecordSink(Protocol):
    """Where readings go; `write` returns only when they are durable."""

    def write(self, readings: Sequence[Reading]) -> None: ...

    def done(self) -> set[tuple[int, int]]:
        """Return the (row, point) pairs that already have a reading."""

    def note(self, key: str, value: object) -> None:
        """Store a settings or event entry (JSON-able)."""

    def close(self) -> None: ...
