"""Zaber stages through the vendor's library, in native units: a chain of single axes or one controller."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from eddyscan.core.errors import MotionError
from eddyscan.core.frames import Array, IntArray
from eddyscan.devices.dead_man import DeadMan
from eddyscan.devices.drivers.zaber_axes import HARMLESS, ConnectedAxis, connect_axes, speeds_to_arrive_together
from eddyscan.devices.drivers.zaber_link import Told, ZaberLink
from eddyscan.devices.drivers.zaber_paths import Follower, Looker, SteeredChain, TimedPoints
from eddyscan.devices.drivers.zaber_settings import ZaberStageSettings
from eddyscan.devices.protocols import Axis, Clock, Identity, PathSample, TimedPath

LOOK_S = 0.1  # of the rig's clock, between two looks at a moving stage
SOON_S = 0.002


class ZaberStage:
    """The study's chain, or any axes listed in the settings; implements `Stage`.

    Unverified on hardware: it runs with the real library against the simulated
    controller. `stop` may be called from any thread; everything else has one
    owner at a time.

    Raises
    ------
    LinkError
        When nobody answers at the address.
    DeviceError
        When an axis reports a travel that contradicts the table.
    """

    def __init__(self, settings: ZaberStageSettings, clock: Clock) -> None:
        self.settings, self.clock = settings, clock
        self._owner = threading.RLock()
        self._stops = self._path_stops = 0
        self._follower: Follower | None = None
        self._path_end: IntArray = np.zeros(0, dtype=np.int64)
        self._link = ZaberLink(settings)
        try:
            self._axes = connect_axes(self._link, settings)
        except BaseException:
            self._link.close()
            raise
        where = (settings.host, settings.port) if settings.host else str(settings.serial_port)
        self._dead_man = DeadMan(where, self._last_words()) if settings.dead_man else None

    # -- who it is ---------------------------------------------------------------

    def identity(self) -> Identity:
        """Return models, serial numbers, firmware and every setting read at connect."""
        return Identity(
            kind="zaber",
            model=" + ".join(axis.table.model for axis in self._axes),
            serial=" + ".join(axis.reported["system.serial"] for axis in self._axes),
            firmware=" + ".join(axis.reported["version"] for axis in self._axes),
            verified=False,
            settings=tuple((f"{a.table.name}.{key}", value) for a in self._axes for key, value in a.reported.items()),
        )

    def axes(self) -> Sequence[Axis]:
        """Return the axes as they reported themselves at connect [mm or deg]."""
        return tuple(axis.described() for axis in self._axes)

    # -- motion --------------------------------------------------------------------

    def home(self) -> None:
        """Reference every axis, z first: it carries the probe away from the part."""
        with self._owner:
            stops = self._stops
            first = [axis for axis in self._axes if axis.table.name == "z"]
            for group in (first, [axis for axis in self._axes if axis not in first]):
                for axis in group:
                    self._link.act(*axis.where, "home", lambda a: a.home(wait_until_idle=False))
                if group:
                    self._wait(group, stops, homing=True)

    def is_homed(self) -> bool:
        """Return whether every axis has its reference."""
        with self._owner:
            return all(not {"WR", "WH"} & set(self._ask(axis, "warnings").data.split()) for axis in self._axes)

    def move(self, target: Array, speed: float | None = None) -> None:
        """Move all axes to `target` (n_axes,) [mm or deg], arriving together, and verify.

        Raises
        ------
        TravelError
            Before anything moves, when a target lies outside an axis.
        MotionError
            On a stall, a stop, a lost reference or a missed target.
        LinkError
            When the stage does not answer.
        """
        counts = self._counts(target)
        with self._owner:
            stops = self._stops
            here = np.array([axis.last_count for axis in self._axes])
            going = [i for i in range(len(counts)) if counts[i] != here[i]]
            plan = speeds_to_arrive_together(self._axes, counts - here, speed)
            self._refuse_if_stopped(stops)
            for i in going:
                self._axes[i].start_move(self._link, int(counts[i]), plan)
            self._wait([self._axes[i] for i in going], stops, expected_s=plan.duration_s)
            self._verify(counts)

    def path_modes(self) -> tuple[str, ...]:
        """Return "row" always, "pvt" where one controller with firmware 7 holds all axes."""
        one_device = len({axis.table.device for axis in self._axes}) == 1 and len(self._axes) > 1
        return ("row", "pvt") if one_device and self._axes[0].takes_speed_with_move else ("row",)

    def start_path(self, path: TimedPath, mode: str) -> float:
        """Begin to follow `path` from its start, where the stage must stand; return its time zero.

        Raises
        ------
        TravelError
            Before anything moves, when any of its positions lies outside an axis.
        MotionError
            When the stage stands elsewhere or cannot follow in this mode.
        """
        counts = [self._counts(position) for position in path.position]
        with self._owner:
            if mode not in self.path_modes():
                raise MotionError(f"this stage follows paths as {', '.join(self.path_modes())}, not as {mode}.")
            self._verify(counts[0])
            self._path_stops = self._stops
            looker = Looker(self._link, self._axes, self.clock, self.settings.read_retries)
            self._follower = TimedPoints(looker, path) if mode == "pvt" else SteeredChain(looker, path)
            self._path_end = counts[-1]
            return self._follower.began_s

    def follow_path(self) -> PathSample:
        """Read the axes and keep them on the path; verifies the end when nothing moves any more."""
        with self._owner:
            if self._follower is None:
                raise MotionError("no path was begun; call start_path first.")
            self._refuse_if_stopped(self._path_stops)
            sample = self._follower.step()
            self._refuse_if_stopped(self._path_stops)
            self._refuse_faults(self._follower.looked_at, self._follower.told, homing=False)
            if not sample.moving:
                self._follower = None
                self._verify(self._path_end)
            return sample

    def position(self) -> Array:
        """Return measured positions (n_axes,) [mm or deg]; step counts where an axis has no encoder."""
        with self._owner:
            for axis in self._axes:
                self._look(axis)
            return np.array([axis.reading(axis.last_count) for axis in self._axes])

    def stop(self) -> None:
        """Stop every axis now: one line to all devices, past any queue; opens a lost line again."""
        self._stops += 1
        self._link.broadcast("stop")

    def close(self) -> None:
        """Give back changed settings and close the line."""
        with self._owner:
            for axis in self._axes:
                axis.restore(self._link)
            self._link.close()
            if self._dead_man is not None:
                self._dead_man.dismiss()

    # -- how it waits ------------------------------------------------------------------

    def _wait(
        self, going: list[ConnectedAxis], stops: int, *, expected_s: float | None = None, homing: bool = False
    ) -> None:
        """Wait until all axes in `going` rest, watching flags and measured progress."""
        arrival = self.clock.now() + (expected_s or 0.0)
        before, moved_at = [axis.last_count for axis in going], self.clock.now()
        while True:
            left = arrival - self.clock.now()
            pause = LOOK_S if homing else SOON_S
            self.clock.sleep(min(left, LOOK_S) if left > 0 else (pause if expected_s is None else 0.0))
            self._refuse_if_stopped(stops)
            told = [self._look(axis) for axis in going]
            self._refuse_faults(going, told, homing=homing)
            if not any(answer.busy for answer in told):
                return
            after = [axis.last_count for axis in going]
            if after != before:
                before, moved_at = after, self.clock.now()
            elif self.clock.now() - moved_at > self.settings.no_progress_s:
                self._give_up(going)
            if left <= 0 and expected_s is not None:
                self.clock.sleep(SOON_S)

    def _last_words(self) -> bytes:
        """Return what stops all axes and lifts z: axes that brake each on its own leave the path, z must go up."""
        up = ""
        for axis in self._axes:
            if axis.table.name == "z":
                end = axis.reported["limit.min" if axis.table.inverted else "limit.max"]
                up += f"/{axis.table.device} {axis.table.axis} move abs {end}\n"
        return f"/stop\n{up}".encode()

    def _look(self, axis: ConnectedAxis) -> Told:
        told = self._ask(axis, "get pos")
        axis.heard(told.data)
        return told

    def _ask(self, axis: ConnectedAxis, command: str) -> Told:
        return self._link.tell(*axis.where, command, retries=self.settings.read_retries)

    def _counts(self, target: Array) -> IntArray:
        values = np.asarray(target, dtype=np.float64)
        if values.shape != (len(self._axes),):
            raise MotionError(f"a target for this stage has {len(self._axes)} values, {values.shape} were given.")
        return np.array([axis.checked_count(float(v)) for axis, v in zip(self._axes, values, strict=True)])

    def _refuse_if_stopped(self, stops: int) -> None:
        if stops != self._stops:
            raise MotionError("the stage was stopped on request. Check the probe, then move again.")

    def _refuse_faults(self, going: list[ConnectedAxis], told: list[Told], *, homing: bool) -> None:
        for axis, answer in zip(going, told, strict=True):
            if answer.warning in HARMLESS or (homing and answer.warning in ("WR", "WH")):
                continue
            self._halt()
            self._ask(axis, "warnings clear")
            raise MotionError(
                f"axis {axis.table.name} reports {axis.meaning(answer.warning)} at "
                f"{axis.reading(axis.last_count):.3f} {axis.table.unit}; all axes were told to stop. "
                "Free the axis, home the stage and run again."
            )

    def _halt(self) -> None:
        """Stop after a fault and wait until every axis rests, at most as long as braking can take."""
        self.stop()
        longest = max(axis.max_speed / axis.acceleration for axis in self._axes) + LOOK_S
        until = self.clock.now() + longest
        while any(self._look(axis).busy for axis in self._axes) and self.clock.now() < until:
            self.clock.sleep(SOON_S)

    def _give_up(self, going: list[ConnectedAxis]) -> None:
        self._halt()
        places = ", ".join(f"{a.table.name} at {a.reading(a.last_count):.3f} {a.table.unit}" for a in going)
        raise MotionError(
            f"the stage says it moves but covered nothing for {self.settings.no_progress_s:g} s ({places}); "
            "all axes were told to stop. Free the axis, home the stage and run again."
        )

    def _verify(self, counts: IntArray) -> None:
        for i, axis in enumerate(self._axes):
            told = self._look(axis) if axis.last_count != counts[i] else None
            off = axis.reading(axis.last_count) - axis.reading(int(counts[i]))
            if abs(off) > self.settings.tolerance:
                self._halt()
                flag = f", flag {told.warning}" if told and told.warning != "--" else ""
                raise MotionError(
                    f"axis {axis.table.name} stands {off:+.4f} {axis.table.unit} from its target "
                    f"{axis.reading(int(counts[i])):.4f} (limit {self.settings.tolerance:g}){flag}: "
                    "the move was stopped or pre-empted. Home the stage and run again."
                )
