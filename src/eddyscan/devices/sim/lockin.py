"""A simulated SR830 or SR860 with the coil in a voltage divider: commands, output filter, overload.

Which commands: those that PyMeasure and our driver send. The output filter is
a row of equal first-order stages, run up to the moment of each query with the
coil as it is then; between queries the coil is taken to stand still.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

from eddyscan.devices.protocols import Clock
from eddyscan.devices.sim.instrument_wire import InstrumentServer, LinkLost
from eddyscan.devices.sim.lcr import Coil
from eddyscan.devices.sim.world_settings import WorldFaults

SOURCE_OHM = 50.0
INPUT_OVERLOAD, OUTPUT_OVERLOAD = 1, 4
STEPS = (1.0, 2.0, 5.0)


@dataclass(frozen=True)
class LockInModel:
    """What differs between the two models."""

    name: str
    highest_hz: float
    sensitivities_v: tuple[float, ...]
    time_constants_s: tuple[float, ...]
    overload_query: str
    sensitivity_header: str
    snap_xy: str


def _steps(first_exponent: int, count: int, mantissas: tuple[float, ...], start: int = 0) -> tuple[float, ...]:
    n = len(mantissas)
    return tuple(mantissas[k % n] * 10.0 ** (first_exponent + k // n) for k in range(start, start + count))


MODELS = {
    "SR830": LockInModel(
        "SR830", 102e3, _steps(-9, 27, STEPS, 1), _steps(-5, 20, (1.0, 3.0)), "LIAS?", "SENS", "SNAP? 1,2"
    ),
    "SR860": LockInModel(
        "SR860", 500e3, _steps(-9, 28, STEPS)[::-1], _steps(-6, 22, (1.0, 3.0)), "CUROVLDSTAT?", "SCAL", "SNAP? 0,1"
    ),
}


class LockInSimulator:
    """The lock-in: sine output, divider, filter, answers.

    Parameters
    ----------
    coil : Coil
    clock : Clock
        The filter runs in this clock's time.
    model : {"SR830", "SR860"}
    series_ohm : float [ohm]
        Resistor between sine output and coil.
    latency_s : float [s]
        Time of one answer.
    """

    def __init__(
        self,
        coil: Coil,
        clock: Clock,
        *,
        model: str = "SR830",
        series_ohm: float = 1000.0,
        latency_s: float = 0.002,
        faults: WorldFaults | None = None,
    ) -> None:
        self._coil, self._clock, self._model = coil, clock, MODELS[model]
        self._series_ohm, self._latency_s, self._faults = series_ohm, latency_s, faults or WorldFaults()
        self._frequency_hz, self._level_v, self._sensitivity_v = 1000.0, 1.0, 1.0
        self._tau_s, self._stages = 0.1, 2
        self._state: list[complex] = []
        self._updated_s = clock.now()
        self._overloaded = 0
        self.readings = 0
        self._server = InstrumentServer(self.answer)

    def start(self, port: int = 0) -> tuple[str, int]:
        """Listen; return (host, port)."""
        return self._server.start(port)

    def close(self) -> None:
        """Stop listening."""
        self._server.close()

    def answer(self, line: str) -> str | None:
        """Obey one command; return its answer, if it is a query."""
        command = line.strip().rstrip(";")
        if command.replace(" ", "") == self._model.snap_xy.replace(" ", ""):
            return self._snap()
        if command == self._model.overload_query:
            status, self._overloaded = self._overloaded, 0
            return str(status)
        if command.endswith("?"):
            return self._query(command[:-1].strip())
        self._set(command)
        return None

    def _query(self, header: str) -> str | None:
        answers = {
            "*IDN": f"Stanford_Research_Systems,{self._model.name},s/n00042,ver1.07",
            "FREQ": f"{self._frequency_hz:.6g}",
            "SLVL": f"{self._level_v:.3f}",
            "OFSL": str(self._stages - 1),
            self._model.sensitivity_header: str(self._nearest(self._model.sensitivities_v, self._sensitivity_v)),
            "OFLT": str(self._nearest(self._model.time_constants_s, self._tau_s)),
        }
        return answers.get(header)

    def _set(self, command: str) -> None:
        head, value = command[:4], command[4:].strip()
        if head == "FREQ":
            self._frequency_hz = min(max(float(value), 0.001), self._model.highest_hz)
            self._coil.prepare(self._frequency_hz)
            self._state = []
        elif head == "SLVL":
            self._level_v = float(value)
            self._state = []
        elif head == self._model.sensitivity_header:
            self._sensitivity_v = self._model.sensitivities_v[int(value)]
        elif head == "OFLT":
            self._tau_s = self._model.time_constants_s[int(value)]
        elif head == "OFSL":
            self._stages = int(value) + 1

    def _snap(self) -> str:
        if 0 < self._faults.lcr_link_lost_after <= self.readings:
            raise LinkLost
        if 0 < self._faults.lcr_silent_after <= self.readings:
            threading.Event().wait(30.0)
            raise LinkLost
        self._clock.sleep(self._latency_s / 2)
        voltage = self._filtered(self._coil_voltage())
        self._clock.sleep(self._latency_s / 2)
        self.readings += 1
        if max(abs(voltage.real), abs(voltage.imag)) > 1.09 * self._sensitivity_v:
            self._overloaded |= OUTPUT_OVERLOAD
        x, y = f"{voltage.real:.8e}", f"{voltage.imag:.8e}"
        self._coil.sent(self._impedance_ohm(complex(float(x), float(y))))
        return f"{x},{y}"

    def _coil_voltage(self) -> complex:
        z = self._coil.read(self._frequency_hz, self._tau_s * self._stages)
        return self._level_v * z / (z + self._series_ohm + SOURCE_OHM)

    def _impedance_ohm(self, voltage: complex) -> complex:
        ratio = voltage / self._level_v
        return (self._series_ohm + SOURCE_OHM) * ratio / (1 - ratio)

    def _filtered(self, voltage: complex) -> complex:
        """Run the filter's stages up to now with the coil as it is now."""
        now = self._clock.now()
        gone, self._updated_s = now - self._updated_s, now
        if len(self._state) != self._stages:
            self._state = [voltage] * self._stages
        steps = min(200, max(1, math.ceil(5 * gone / self._tau_s)))
        keep = math.exp(-gone / steps / self._tau_s)
        for _ in range(steps):
            value = voltage
            for k in range(self._stages):
                self._state[k] = value + (self._state[k] - value) * keep
                value = self._state[k]
        return self._state[-1]

    @staticmethod
    def _nearest(steps: tuple[float, ...], value: float) -> int:
        return min(range(len(steps)), key=lambda k: abs(steps[k] - value))
