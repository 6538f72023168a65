"""What keeps a real reading from being exact: noise, 1/f, temperature, null offset, digits."""

from __future__ import annotations

import numpy as np

from eddyscan.devices.sim.world_settings import WorldInstrument

FLICKER_TIMES_S = (0.1, 1.0, 10.0, 100.0, 1000.0)


class ReadingNoise:
    """The imperfections of one instrument with its cable, in the order readings are taken.

    1/f noise is a sum of first-order random walks with time constants a decade
    apart, which has a 1/f spectrum between their corners.
    """

    def __init__(self, options: WorldInstrument, seed: int) -> None:
        self._options = options
        self._rng = np.random.default_rng([seed, 8])
        fixed = np.random.default_rng([seed, 9])
        self._phase = fixed.uniform(0.0, 2 * np.pi)
        self._null = options.null_offset_ohm * np.exp(2j * np.pi * fixed.uniform())
        self._walks = np.array([self._draw() for _ in FLICKER_TIMES_S])
        self._last_s: float | None = None

    def temperature_k(self, time_s: float) -> float:
        """Return the difference to the temperature at the null [K]."""
        o = self._options
        return 0.5 * o.drift_k * float(np.sin(2 * np.pi * time_s / o.drift_period_s + self._phase))

    def apply(self, impedance_ohm: complex, air_ohm: complex, time_s: float, aperture_s: float) -> complex:
        """Return a reading of `impedance_ohm` (coil without wire) taken at `time_s` over `aperture_s`."""
        o = self._options
        warm = self.temperature_k(time_s)
        wire = o.wire_resistance_ohm * (1.0 + o.wire_per_k * warm)
        shorter = np.sqrt(o.short_s / max(aperture_s, 1e-9))
        white = o.noise * abs(air_ohm) * shorter * self._draw()
        flicker = o.flicker * abs(air_ohm) * self._flicker(time_s)
        return complex(impedance_ohm + wire + self._null + white + flicker)

    def _draw(self) -> complex:
        """Return a complex normal draw of unit mean square."""
        real, imaginary = self._rng.standard_normal(2) / np.sqrt(2)
        return complex(real, imaginary)

    def _flicker(self, time_s: float) -> complex:
        gone = 0.0 if self._last_s is None else max(time_s - self._last_s, 0.0)
        self._last_s = time_s
        for k, tau in enumerate(FLICKER_TIMES_S):
            keep = np.exp(-gone / tau)
            self._walks[k] = keep * self._walks[k] + np.sqrt(1 - keep**2) * self._draw()
        return complex(self._walks.sum())
