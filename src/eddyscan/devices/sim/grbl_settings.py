"""What the simulated GRBL machine is made of; speeds, travel and accuracy are PLACEHOLDERS of a small router."""

from __future__ import annotations

from pydantic import Field

from eddyscan.core.technique import Section
from eddyscan.devices.sim.zaber_settings import SimulatedAxis


def _axis(name: str, **values: float | str) -> SimulatedAxis:
    given = {"model": "leadscrew", "microstep": 1 / 800, "max_speed": 30.0, "acceleration": 200.0, **values}
    return SimulatedAxis.model_validate({"name": name, "accuracy": 0.1, "backlash": 0.01, **given})


ROUTER_AXES = (
    _axis("x", travel=300.0, start=60.0),
    _axis("y", travel=200.0, start=60.0),
    _axis("z", travel=60.0, start=30.0, max_speed=20.0),
)
TILT_AXIS = _axis("b", unit="deg", travel=120.0, lower=-60.0, start=0.0, microstep=0.005, accuracy=0.05)


class GrblSettings(Section):
    """The simulated machine; a fourth axis b tilts the probe."""

    axes: tuple[SimulatedAxis, ...] = ROUTER_AXES
    version: str = "1.1h"
    reply_delay_s: float = Field(0.002, ge=0)
    host: str = "127.0.0.1"
    seed: int = Field(1, ge=0)
