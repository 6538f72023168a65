"""Motion at constant acceleration: what a stage's controller makes of a move.

Units are the caller's (mm and s, or microsteps and s), the same throughout.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt


@dataclass(frozen=True)
class Piece:
    """A stretch of constant acceleration."""

    duration: float
    acceleration: float


@dataclass(frozen=True)
class Motion:
    """A motion from (start, velocity) through its pieces, then at rest.

    `at` and `velocity_at` take seconds since the start.
    """

    start: float
    velocity: float = 0.0
    pieces: tuple[Piece, ...] = ()

    @property
    def duration(self) -> float:
        """Return seconds until rest."""
        return sum(piece.duration for piece in self.pieces)

    @property
    def end(self) -> float:
        """Return the position at rest."""
        return self.state(self.duration)[0]

    def state(self, elapsed: float) -> tuple[float, float]:
        """Return (position, velocity) `elapsed` seconds after the start."""
        position, velocity, left = self.start, self.velocity, max(elapsed, 0.0)
        for piece in self.pieces:
            step = min(piece.duration, left)
            position += velocity * step + 0.5 * piece.acceleration * step * step
            velocity += piece.acceleration * step
            left -= step
            if left <= 0:
                return position, velocity
        return position, 0.0


def move(start: float, target: float, *, speed: float, acceleration: float, velocity: float = 0.0) -> Motion:
    """Plan a move to rest at `target` from any velocity; brakes and returns when it cannot stop in time."""
    pieces: list[Piece] = []
    position, v = start, velocity
    distance = target - position
    forward = 1.0 if distance >= 0 else -1.0
    if v * forward < 0 or v * v / (2 * acceleration) > abs(distance) * (1 + 1e-12):
        pieces.append(Piece(abs(v) / acceleration, -acceleration if v > 0 else acceleration))
        position += v * abs(v) / (2 * acceleration)
        v, distance = 0.0, target - position
        forward = 1.0 if distance >= 0 else -1.0
    pieces.extend(_towards(abs(distance), abs(v), forward, (speed, acceleration)))
    return Motion(start, velocity, tuple(piece for piece in pieces if piece.duration > 0))


def _towards(distance: float, v: float, forward: float, limits: tuple[float, float]) -> list[Piece]:
    """Return the pieces that cover `distance` ahead from speed `v`, ending at rest."""
    speed, a = limits
    if v > speed:
        slowing = (v * v - speed * speed) / (2 * a)
        stopping = speed * speed / (2 * a)
        cruise = max(distance - slowing - stopping, 0.0)
        return [Piece((v - speed) / a, -a * forward), Piece(cruise / speed, 0.0), Piece(speed / a, -a * forward)]
    peak = min(speed, sqrt(a * distance + 0.5 * v * v))
    ramps = (2 * peak * peak - v * v) / (2 * a)
    cruise = max(distance - ramps, 0.0)
    return [
        Piece((peak - v) / a, a * forward),
        Piece(cruise / peak if peak else 0.0, 0.0),
        Piece(peak / a, -a * forward),
    ]


def brake(start: float, velocity: float, acceleration: float) -> Motion:
    """Plan the shortest stop from `velocity`."""
    if velocity == 0:
        return Motion(start)
    sign = -1.0 if velocity > 0 else 1.0
    return Motion(start, velocity, (Piece(abs(velocity) / acceleration, sign * acceleration),))


def rest_to_rest_s(distance: float, speed: float, acceleration: float) -> float:
    """Return how long a move over `distance` takes from rest to rest."""
    return move(0.0, abs(distance), speed=speed, acceleration=acceleration).duration
