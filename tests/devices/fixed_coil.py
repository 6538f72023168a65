"""A coil of known impedance for the simulated instruments: exact but for a little noise."""

import numpy as np

INDUCTANCE_H = 12e-6
RESISTANCE_OHM = 1.5


class FixedCoil:
    """Series resistance and inductance with 10 ppm of noise; keeps what went over the wire."""

    def __init__(self, scale=1.0):
        self.scale = scale
        self.sent_values = []
        self._rng = np.random.default_rng(3)

    def true_ohm(self, frequency_hz):
        return self.scale * (RESISTANCE_OHM + 2j * np.pi * frequency_hz * INDUCTANCE_H)

    def read(self, frequency_hz, aperture_s):
        z = self.true_ohm(frequency_hz)
        return complex(z * (1 + 1e-5 * complex(*self._rng.standard_normal(2))))

    def prepare(self, frequency_hz):
        pass

    def sent(self, impedance_ohm):
        self.sent_values.append(impedance_ohm)
