"""Moving the stage by hand: keys in, moves out. The terminal around it belongs to the command line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from eddyscan.core.errors import TravelError
from eddyscan.core.frames import Array
from eddyscan.devices.protocols import Stage

STEPS_MM = (0.01, 0.1, 1.0, 10.0)
SPEED_MM_S = 5.0
DOWN_SPEED_MM_S = 2.0
LONGEST_DOWN_MM = 1.0
KEYS = {
    "left": (0, -1.0),
    "right": (0, 1.0),
    "down": (1, -1.0),
    "up": (1, 1.0),
    "pagedown": (2, -1.0),
    "pageup": (2, 1.0),
}
HELP = "arrows: x and y, page up and down: z, + and -: step, Enter: take this point, h: home, space: stop, q: done"


@dataclass(frozen=True)
class JogState:
    """What the terminal shows.

    Attributes
    ----------
    position : (n_axes,) axis readings [mm]
    step_mm : step per key
    points_mm : touched points so far, (3,) each [mm, stage]
    message : what happened, in words
    done : the operator is finished
    """

    position: Array
    step_mm: float
    points_mm: tuple[Array, ...] = ()
    message: str = ""
    done: bool = False


class JogSession:
    """One operator at the keys of one stage.

    Downward steps are cut to `LONGEST_DOWN_MM` and slow: below is the part. A
    key that would leave the travel is refused in words and moves nothing.
    """

    def __init__(self, stage: Stage, *, step_mm: float = 1.0) -> None:
        self._stage = stage
        self.state = JogState(stage.position(), step_mm, message=HELP)

    def press(self, key: str) -> JogState:
        """Act on one key; faults of the stage are raised, refused moves only told."""
        state = replace(self.state, message="")
        if key in KEYS:
            state = self._step(state, *KEYS[key])
        elif key in ("+", "-"):
            state = replace(state, step_mm=_next_step(state.step_mm, 1 if key == "+" else -1))
        elif key == "enter":
            point = self._stage.position()[:3]
            state = replace(
                state, points_mm=(*state.points_mm, point), message=f"point {len(state.points_mm) + 1} taken"
            )
        elif key == "h":
            self._stage.home()
            state = replace(state, message="homed")
        elif key == "space":
            self._stage.stop()
            state = replace(state, message="stopped")
        elif key == "q":
            state = replace(state, done=True)
        else:
            state = replace(state, message=HELP)
        self.state = replace(state, position=self._stage.position())
        return self.state

    def _step(self, state: JogState, axis: int, direction: float) -> JogState:
        down = axis == 2 and direction < 0
        step = min(state.step_mm, LONGEST_DOWN_MM) if down else state.step_mm
        target = np.array(state.position, dtype=np.float64)
        target[axis] += direction * step
        try:
            self._stage.move(target, DOWN_SPEED_MM_S if down else SPEED_MM_S)
        except TravelError as refused:
            return replace(state, message=str(refused))
        cut = f"down only {step:g} mm at a time" if down and step < state.step_mm else ""
        return replace(state, message=cut)


def _next_step(step_mm: float, change: int) -> float:
    index = int(np.argmin([abs(step_mm - s) for s in STEPS_MM])) + change
    return STEPS_MM[min(max(index, 0), len(STEPS_MM) - 1)]
