"""The rig of an inspection: opened when a step needs it, closed with the run."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from eddyscan.core.errors import FileError, InputError
from eddyscan.inspection import Inspection, read_toml

if TYPE_CHECKING:
    from eddyscan.devices.rig import Rig, RigSettings

RIG_HEADING = """The rig: it changes with a spanner. As written here it is the virtual cell, a
simulated stage and instrument on the loopback. A real rig needs
`eddyscan run DIR --rig lab.toml --arm` every time."""

MOVING_FACTOR = 5.0  # beyond this, jitter of the computer is a millimetre of a row read in motion
PLACING_MM = 2.0  # a part is set on the stage by eye, so not all of the z travel lies where the part needs it


def virtual_rig_text(part: str, seed: int) -> str:
    """Return a commented rig.toml of the virtual cell."""
    from eddyscan.devices.rig import rig_text, virtual_rig

    return rig_text(virtual_rig(part=part, seed=seed), RIG_HEADING)


def require_same_cell(inspection: Inspection, part: str, seed: int) -> None:
    """Raise FileError when the folder's virtual cell holds another part or seed."""
    from eddyscan.devices.rig import RigSettings

    world = read_toml(inspection.rig_file, RigSettings).world
    held = (world.part, world.seed) if world is not None else ("a real rig", "-")
    if held != (part, seed):
        raise FileError(
            f"{inspection.folder} already holds {held[0]}, seed {held[1]}, not {part}, seed {seed}. "
            "Name another folder with --out."
        )


class LazyRig:
    """Opens the rig once, on first use, and closes it when the run ends."""

    def __init__(self, inspection: Inspection, rig_file: Path | None, arm: bool, stack: ExitStack) -> None:
        self._inspection = inspection
        self._file = rig_file or inspection.rig_file
        self._given = rig_file is not None
        self._arm = arm
        self._stack = stack
        self._rig: Rig | None = None

    @property
    def opened(self) -> Rig | None:
        """Return the rig if a step has opened it."""
        return self._rig

    def settings(self) -> RigSettings:
        """Read and check rig.toml; the virtual cell of block-a when the folder has none."""
        from eddyscan.devices.rig import RigSettings, virtual_rig

        if not self._file.is_file() and not self._given:
            return virtual_rig(part=self._inspection.technique().part.name, seed=1)
        return read_toml(self._file, RigSettings)

    def open(self) -> Rig:
        """Open the rig, or raise InputError when it is real and not armed."""
        if self._rig is None:
            from eddyscan.devices.rig import open_rig

            settings = self.settings()
            if settings.world is None and not (self._given and self._arm):
                raise InputError(
                    f"{self._file} is a real rig; it moves only with --rig {self._file} --arm given at the terminal."
                )
            self._rig = self._stack.enter_context(open_rig(self._in_time(settings)))
        return self._rig

    def _in_time(self, settings: RigSettings) -> RigSettings:
        """Return the settings with a virtual clock slow enough for the technique: moving readings need finer time."""
        world = settings.world
        if world is None or self._inspection.technique().scan.mode == "step" or world.time_factor <= MOVING_FACTOR:
            return settings
        return settings.model_copy(update={"world": world.model_copy(update={"time_factor": MOVING_FACTOR})})

    def travel_mm(self) -> tuple[float, float, float] | None:
        """Return the x, y, z travels the plan has to fit into: rig.toml's, less what placing the part costs in z."""
        x_mm, y_mm, z_mm = self.settings().travel_mm
        return x_mm, y_mm, z_mm - PLACING_MM
