"""How Zaber axes follow a timed path: a chain by steering each axis, a controller by timed points.

Both are safe to abandon: every command in the controller ends at a point of
the path a fraction of a second ahead, so a computer that dies leaves axes that
come to rest by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from eddyscan.core.frames import Array
from eddyscan.devices.drivers.zaber_axes import HARMLESS, ConnectedAxis
from eddyscan.devices.drivers.zaber_link import Told, ZaberLink
from eddyscan.devices.protocols import Clock, PathSample, TimedPath

FIRST_ROUND_S = 0.01  # assumed length of a steering round until one was measured
AHEAD_S = 0.5  # how much of the path a controller holds at least
STILL = 0.02  # [unit/s] below this an axis is left alone


class Follower(Protocol):
    """Keeps axes on a path, one call at a time."""

    began_s: float
    told: list[Told]
    looked_at: list[ConnectedAxis]

    def step(self) -> PathSample: ...


class Looker:
    """Reads axes and stamps each answer with the middle of its round trip."""

    def __init__(self, link: ZaberLink, axes: Sequence[ConnectedAxis], clock: Clock, retries: int) -> None:
        self.link, self.axes, self.clock, self._retries = link, axes, clock, retries

    def look(self, which: Sequence[int]) -> tuple[Array, Array, list[Told]]:
        """Return (times, positions) (n_axes,) and the answers; axes not asked keep their last count."""
        times = np.full(len(self.axes), self.clock.now())
        told = []
        for i in which:
            axis, asked = self.axes[i], self.clock.now()
            answer = self.link.tell(*axis.where, "get pos", retries=self._retries)
            axis.heard(answer.data)
            times[i] = 0.5 * (asked + self.clock.now())
            told.append(answer)
        return times, np.array([axis.reading(axis.last_count) for axis in self.axes]), told


class SteeredChain:
    """Single axes without a common clock: each is sent ahead on the path and its speed is corrected.

    Every round asks each moving axis where it is, and sends it on to the path's
    farthest point in its direction a braking distance ahead, with the path's
    mean speed over the coming round plus what its lag asks for.
    """

    def __init__(self, looker: Looker, path: TimedPath) -> None:
        self._looker, self._path, self._clock = looker, path, looker.clock
        self._moving = [i for i in range(len(looker.axes)) if np.ptp(path.position[:, i]) > 0]
        self.told: list[Told] = []
        self.looked_at = [looker.axes[i] for i in self._moving]
        self._round_s = FIRST_ROUND_S
        self._ended = False
        self._sent: dict[int, tuple[int, int]] = {}
        self.began_s = looker.clock.now() + FIRST_ROUND_S
        self._last = looker.clock.now()

    def step(self) -> PathSample:
        """Run one steering round."""
        times, positions, self.told = self._looker.look(self._moving)
        if _faulty(self.told):
            return PathSample(times, positions, moving=True)
        now = self._clock.now()
        self._round_s = 0.7 * self._round_s + 0.3 * min(max(now - self._last, 1e-3), 0.2)
        self._last = now
        for i in self._moving:
            if now - self.began_s < self._path.duration_s:
                self._steer(i, float(times[i]), float(positions[i]))
            elif not self._ended:
                self._send(i, float(self._path.position[-1, i]), self._looker.axes[i].max_speed)
        ending = now - self.began_s >= self._path.duration_s
        moving = not self._ended or any(answer.busy for answer in self.told)
        self._ended = ending
        return PathSample(times, positions, moving)

    def _steer(self, i: int, stamp: float, position: float) -> None:
        axis, since = self._looker.axes[i], self._clock.now() - self.began_s
        coming = self._round_s
        wanted, _ = self._path.at(since)
        soon, _ = self._path.at(since + coming)
        lag = float(self._path.at(stamp - self.began_s)[0][i]) - position
        speed = float(soon[i] - wanted[i]) / coming + lag / (2 * coming + 0.01)
        speed = float(np.clip(speed, -axis.max_speed, axis.max_speed))
        if abs(speed) < STILL:
            return
        self._send(i, self._aim(i, since, position, speed), abs(speed))

    def _aim(self, i: int, since: float, position: float, speed: float) -> float:
        """Return how far ahead to send an axis: beyond its braking distance, never out of the path's range."""
        axis, direction = self._looker.axes[i], float(np.sign(speed))
        brake = speed * speed / (2 * axis.acceleration) + 3 * abs(speed) * self._round_s
        ahead = brake / abs(speed) + self._round_s
        coming = [float(self._path.at(since + share * ahead)[0][i]) for share in (0.5, 0.75, 1.0)]
        farthest = max(direction * p for p in coming)
        aim = direction * max(farthest, direction * position + brake)
        return float(np.clip(aim, self._path.position[:, i].min(), self._path.position[:, i].max()))

    def _send(self, i: int, aim: float, speed: float) -> None:
        axis = self._looker.axes[i]
        count, native = axis.checked_count(aim), max(abs(axis.native_speed(speed)), 1)
        if self._sent.get(i) != (count, native):
            axis.send_on(self._looker.link, count, native)
            self._sent[i] = (count, native)


class TimedPoints:
    """One controller that plays position-velocity-time points: smooth and exact on all axes."""

    def __init__(self, looker: Looker, path: TimedPath, grid_s: float = 0.04) -> None:
        self._looker, self._clock, self._path = looker, looker.clock, path
        self._which = list(range(len(looker.axes)))
        self._moving = [i for i in self._which if np.ptp(path.position[:, i]) > 0]
        self.told: list[Told] = []
        self.looked_at = [looker.axes[i] for i in self._moving]
        n = max(int(np.ceil(path.duration_s / grid_s)), 1)
        self._ends_s = np.round(np.linspace(0.0, path.duration_s, n + 1)[1:], 3)
        self._next = 0
        for axis in looker.axes:  # the library refuses points while an old flag stands
            looker.link.tell(*axis.where, "warnings clear")
        self._device = looker.axes[0].table.device
        self._sequence: Any = looker.link.device_of(self._device).pvt.get_sequence(1)
        self._call("pvt disable", self._sequence.disable)  # a stroke that was given up leaves it set
        self._call("pvt setup", lambda: self._sequence.setup_live(*[a.table.axis for a in looker.axes]))
        self._call("pvt cork", self._sequence.cork)
        self._feed(AHEAD_S)
        self._call("pvt uncork", self._sequence.uncork)
        self.began_s = looker.clock.now()

    def step(self) -> PathSample:
        """Look at the axes and send the points of the coming half second."""
        times, positions, self.told = self._looker.look(self._moving)
        if _faulty(self.told):
            return PathSample(times, positions, moving=True)
        self._feed(self._clock.now() - self.began_s + AHEAD_S)
        moving = self._next < len(self._ends_s) or any(answer.busy for answer in self.told)
        if not moving:
            self._call("pvt disable", self._sequence.disable)
        return PathSample(times, positions, moving)

    def _call(self, what: str, action: Callable[[], Any]) -> None:
        self._looker.link.call(self._device, what, action)

    def _feed(self, until_s: float) -> None:
        while self._next < len(self._ends_s) and (self._next == 0 or self._ends_s[self._next - 1] < until_s):
            self._send_point(self._next)
            self._next += 1

    def _send_point(self, k: int) -> None:
        from zaber_motion import Measurement

        end = float(self._ends_s[k])
        begin = float(self._ends_s[k - 1]) if k else 0.0
        position, velocity = self._path.at(end)
        axes = self._looker.axes
        counts = [Measurement(axes[i].checked_count(float(position[i]))) for i in self._which]
        speeds = [Measurement(axes[i].native_speed(float(velocity[i]))) for i in self._which]
        duration = Measurement(round(1e3 * (end - begin)))
        self._call("pvt point", lambda: self._sequence.point(counts, speeds, duration))


def _faulty(told: Sequence[Told]) -> bool:
    """Return whether an answer carries a fault: then nothing more is sent, the stage tells and stops."""
    return any(answer.warning not in HARMLESS for answer in told)
