"""The study's stage experiment: visit points, read the positions back, compare.

Three positions tell three things: what was planned, what the controller counts
(recorded), and - in the virtual cell only - where the coil really was (true).
An axis without an encoder counts steps, so recorded minus planned says nothing
about the screw, the study's 0.002 um included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import Array
from eddyscan.core.progress import Progress, silent
from eddyscan.devices.protocols import Clock, Stage

STUDY_UM = {"x": (0.002, 0.012), "z": (11.73, 74.11)}  # mean and standard deviation, study section 3.5.2


@dataclass(frozen=True)
class StageExperiment:
    """Points visited.

    Attributes
    ----------
    planned_mm, recorded_mm : (N, 3) axis targets and readings [mm, stage]
    true_mm : (N, 3) or None
        Where the coil really was; only a virtual cell can tell.
    """

    planned_mm: Array
    recorded_mm: Array
    true_mm: Array | None = None

    def statistics_um(self) -> dict[str, dict[str, tuple[float, float]]]:
        """Return per kind ("recorded", "true") and axis the mean and standard deviation off plan [um]."""
        kinds = {"recorded": self.recorded_mm} | ({} if self.true_mm is None else {"true": self.true_mm})
        return {
            kind: {
                axis: (float(1e3 * off[:, k].mean()), float(1e3 * off[:, k].std(ddof=1)))
                for k, axis in enumerate("xyz")
            }
            for kind, off in ((kind, at - self.planned_mm) for kind, at in kinds.items())
        }


def stage_experiment(
    stage: Stage,
    targets_mm: Array,
    *,
    clock: Clock,
    settle_s: float = 0.05,
    speed_mm_s: float | None = None,
    true_position: Callable[[], Array] | None = None,
    progress: Progress = silent,
) -> StageExperiment:
    """Visit points one after the other as the study did, and read the axes back at each.

    Parameters
    ----------
    targets_mm : (N, 3) axis targets [mm, stage], N >= 2; z stays where the plan has it, so keep it clear of the part
    true_position : what the virtual cell knows, called after each reading

    Raises
    ------
    TravelError
        Before anything moves, when a target lies outside an axis.
    """
    targets = np.asarray(targets_mm, dtype=np.float64)
    for k, axis in enumerate(stage.axes()[:3]):
        least, most = float(targets[:, k].min()), float(targets[:, k].max())
        if least < axis.lower or most > axis.upper:
            raise TravelError(
                f"the experiment's points span {axis.name} = {least:.2f} to {most:.2f} mm, the travel is "
                f"{axis.lower:.2f} to {axis.upper:.2f} mm. Shift them, or visit fewer."
            )
    recorded, true = [], []
    for number, target in enumerate(targets, 1):
        stage.move(target, speed_mm_s)
        clock.sleep(settle_s)
        recorded.append(stage.position()[:3])
        if true_position is not None:
            true.append(true_position()[:3])
        progress("stage experiment", number, len(targets))
    return StageExperiment(targets, np.array(recorded), np.array(true) if true else None)
