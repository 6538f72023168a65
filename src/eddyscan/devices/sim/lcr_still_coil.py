"""A coil that nobody moves: what a stand-alone simulated meter is given to measure."""

from __future__ import annotations

import math

from eddyscan.devices.sim.instrument_physics import real_coil
from eddyscan.devices.sim.instrument_physics_noise import ReadingNoise
from eddyscan.devices.sim.world_settings import WorldSettings
from eddyscan.physics import Conductor, air_inductance_h, impedance_ohm


class StillCoil:
    """A coil held over sound metal: what a stand-alone meter is given to measure."""

    def __init__(self, lift_off_mm: float, seed: int = 1) -> None:
        world = WorldSettings(seed=seed)
        self._lift_off_mm, self._conductor = lift_off_mm, Conductor.half_space(world.conductivity_ms_m)
        self._coil = real_coil(world.coil, world.instrument.coil_tolerance, seed)
        self._noise = ReadingNoise(world.instrument, seed)
        self._time_s = 0.0

    def read(self, frequency_hz: float, aperture_s: float) -> complex:
        """Return the impedance [ohm] with the instrument's usual imperfections."""
        self._time_s += aperture_s
        z = complex(impedance_ohm(self._coil, self._conductor, frequency_hz, self._lift_off_mm))
        air = 2j * math.pi * frequency_hz * air_inductance_h(self._coil)
        return self._noise.apply(z, air, self._time_s, aperture_s)

    def prepare(self, frequency_hz: float) -> None:
        """Nothing to get ready."""

    def sent(self, impedance_ohm: complex) -> None:
        """Nobody keeps the truth of a stand-alone meter."""
