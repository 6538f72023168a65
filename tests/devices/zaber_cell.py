"""A simulated Zaber stage and the driver connected to it, as the tests use them."""

from __future__ import annotations

import contextlib
import dataclasses

from zaber_motion import Library

from eddyscan.devices.drivers.zaber import ZaberStage
from eddyscan.devices.drivers.zaber_settings import STUDY_CHAIN, ZaberAxis, ZaberStageSettings
from eddyscan.devices.sim.zaber import ZaberSimulator
from eddyscan.devices.sim.zaber_settings import ZaberSettings

CONTROLLER = tuple(axis.model_copy(update={"device": 1, "axis": n}) for n, axis in enumerate(STUDY_CHAIN, 1))


@dataclasses.dataclass
class Cell:
    simulator: ZaberSimulator
    stage: ZaberStage
    clock: object


def private_store(folder) -> None:
    """Keep the vendor library's cache away from the user's home."""
    Library.enable_device_db_store(str(folder))


def axes_of(settings: ZaberSettings) -> tuple[ZaberAxis, ...]:
    return STUDY_CHAIN if settings.layout == "chain" else CONTROLLER


@contextlib.contextmanager
def zaber_cell(clock, settings: ZaberSettings | None = None, *, home: bool = True, **driver):
    settings = settings or ZaberSettings()
    simulator = ZaberSimulator(settings, clock)
    host, port = simulator.start()
    driver = {"axes": axes_of(settings), "request_timeout_s": 0.5, "dead_man": False, **driver}
    try:
        stage = ZaberStage(ZaberStageSettings(host=host, port=port, **driver), clock)
        try:
            if home:
                stage.home()
            yield Cell(simulator, stage, clock)
        finally:
            simulator.faults.clear()
            stage.close()
    finally:
        simulator.close()
