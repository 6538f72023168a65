"""What eddyscan asks of a device: small protocols, no base class, no registry.

`rig.toml` names ``module:Class``, so a lab's own driver works from its own
package. A driver is synchronous and has one owner; `stop()` alone may be
called from any thread, at any time, more than once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

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
