"""A simulated Keysight E4980A: its SCPI commands on a TCP port, physics behind them.

Which commands: those that PyMeasure's `AgilentE4980` and our driver send, and
the common ones. Aperture times are remembered figures for frequencies above
10 kHz (short 5.6 ms, medium 88 ms, long 220 ms), to be checked on a meter.
"""

from __future__ import annotations

import cmath
import math
import threading
from collections.abc import Callable
from typing import Protocol

from eddyscan.devices.clock import ScaledClock
from eddyscan.devices.protocols import Clock
from eddyscan.devices.sim.instrument_wire import InstrumentServer, LinkLost
from eddyscan.devices.sim.lcr_headers import short_form
from eddyscan.devices.sim.lcr_still_coil import StillCoil
from eddyscan.devices.sim.world_settings import WorldFaults

APERTURES = {"SHOR": 1.0, "MED": 88 / 5.6, "LONG": 220 / 5.6}
OVERLOAD_VALUE = "+9.90000E+37"
NORMAL, OVERLOADED = 0, 1
IDENTITY = "Keysight Technologies,E4980A,VIRTUAL0001,A.07.00"


class Coil(Protocol):
    """What hangs at the meter's terminals."""

    def read(self, frequency_hz: float, aperture_s: float) -> complex:
        """Return the impedance [ohm] the meter finds now, imperfections included."""

    def prepare(self, frequency_hz: float) -> None:
        """Get ready for a frequency that was just set."""

    def sent(self, impedance_ohm: complex) -> None:
        """Be told what the wire carried, digits cut as they were."""


class LcrSimulator:
    """The meter: state, triggers and answers.

    Parameters
    ----------
    coil : Coil
    clock : Clock
        A reading takes its aperture on this clock.
    short_s, latency_s : float [s]
        Short aperture; time from the end of a reading to its answer.
    digits : int
        Significant digits of an answer.
    overload_ohm : float
        Readings above it answer the overload value with status 1.
    faults : WorldFaults or None
    """

    def __init__(
        self,
        coil: Coil,
        clock: Clock,
        *,
        short_s: float = 0.0056,
        latency_s: float = 0.001,
        digits: int = 6,
        overload_ohm: float = 1e5,
        faults: WorldFaults | None = None,
    ) -> None:
        self._coil, self._clock, self._faults = coil, clock, faults
        self._short_s, self._latency_s, self._digits, self._overload_ohm = short_s, latency_s, digits, overload_ohm
        self._server = InstrumentServer(self.answer)
        self.readings = 0
        self._errors: list[str] = []
        self._reset()

    def start(self, port: int = 0) -> tuple[str, int]:
        """Listen; return (host, port)."""
        return self._server.start(port)

    def close(self) -> None:
        """Stop listening."""
        self._server.close()

    def drop_link(self) -> None:
        """Cut the connection, as a pulled cable does."""
        self._server.drop_links()

    def answer(self, line: str) -> str | None:
        """Obey one line; return the answer of the query in it, if any."""
        answers = [self._one(part.strip()) for part in line.split(";") if part.strip()]
        said = [a for a in answers if a is not None]
        return ";".join(said) if said else None

    def _reset(self) -> None:
        self._frequency_hz, self._level_v, self._mode = 1000.0, 1.0, "CPD"
        self._aperture, self._averages, self._trigger = "MED", 1, "INT"
        self._last: str | None = None

    def _one(self, command: str) -> str | None:
        head, _, value = command.lstrip(":").partition(" ")
        key = short_form(head)
        if key in self._queries():
            return self._queries()[key]()
        setter = self._setters().get(key)
        if setter is None:
            self._errors.append(f'-113,"Undefined header; {head}"')
            return None
        try:
            setter(value.strip())
        except (ValueError, KeyError):
            self._errors.append(f'-224,"Illegal parameter value; {command}"')
        return None

    def _queries(self) -> dict[str, Callable[[], str]]:
        return {
            "*IDN?": lambda: IDENTITY,
            "*OPC?": lambda: "+1",
            "FREQ?": lambda: f"{self._frequency_hz:+.5E}",
            "VOLT?": lambda: f"{self._level_v:+.5E}",
            "FUNC:IMP?": lambda: self._mode,
            "TRIG:SOUR?": lambda: self._trigger,
            "APER?": lambda: f"{self._aperture},{self._averages:+d}",
            "SYST:ERR?": lambda: self._errors.pop(0) if self._errors else '+0,"No error"',
            "FETC?": self._fetch,
            "*TRG": self._measure,
        }

    def _setters(self) -> dict[str, Callable[[str], None]]:
        return {
            "*RST": lambda _: self._reset(),
            "*CLS": lambda _: self._errors.clear(),
            "FREQ": self._set_frequency,
            "VOLT": self._set_level,
            "FUNC:IMP": self._set_mode,
            "TRIG:SOUR": self._set_trigger,
            "TRIG": lambda _: self._store(self._measure()),
            "APER": self._set_aperture,
            "FORM": lambda _: None,
            "INIT:CONT": lambda _: None,
            "INIT": lambda _: None,
            "ABOR": lambda _: None,
            "DISP:PAGE": lambda _: None,
            "CORR:LENG": lambda _: None,
            "FUNC:IMP:RANG:AUTO": lambda _: None,
        }

    def _set_frequency(self, value: str) -> None:
        frequency = float(value)
        if not 20.0 <= frequency <= 2e6:
            raise ValueError(value)
        self._frequency_hz = frequency
        self._coil.prepare(frequency)

    def _set_level(self, value: str) -> None:
        level = float(value)
        if not 0.0 <= level <= 20.0:
            raise ValueError(value)
        self._level_v = level

    def _set_mode(self, value: str) -> None:
        if value not in ("RX", "ZTD", "ZTR", "LSRS", "CPD"):
            raise ValueError(value)
        self._mode = value

    def _set_trigger(self, value: str) -> None:
        if value not in ("INT", "BUS", "EXT", "HOLD"):
            raise ValueError(value)
        self._trigger = value

    def _set_aperture(self, value: str) -> None:
        length, _, averages = value.partition(",")
        length = length.strip().upper()
        length = "SHOR" if length == "SHORT" else length
        APERTURES[length]
        self._aperture, self._averages = length, int(averages or 1)

    def _store(self, result: str) -> None:
        self._last = result

    def _fetch(self) -> str:
        """Answer FETCh?: with the internal trigger a fresh reading, else the one last triggered."""
        if self._trigger == "INT" or self._last is None:
            return self._measure()
        return self._last

    def _measure(self) -> str:
        """Take a reading: the coil counts as it is in the middle of the aperture."""
        aperture_s = self._short_s * APERTURES[self._aperture] * self._averages
        self._misbehave()
        self._clock.sleep(aperture_s / 2)
        z = self._coil.read(self._frequency_hz, aperture_s)
        self._clock.sleep(aperture_s / 2 + self._latency_s)
        self.readings += 1
        if self._overloads(z):
            self._coil.sent(complex(float(OVERLOAD_VALUE), float(OVERLOAD_VALUE)))
            return f"{OVERLOAD_VALUE},{OVERLOAD_VALUE},{OVERLOADED:+d}"
        first, second = (f"{value:+.{self._digits - 1}E}" for value in self._in_mode(z))
        self._coil.sent(complex(float(first), float(second)) if self._mode == "RX" else z)
        return f"{first},{second},{NORMAL:+d}"

    def _in_mode(self, z: complex) -> tuple[float, float]:
        omega = 2 * math.pi * self._frequency_hz
        if self._mode == "RX":
            return z.real, z.imag
        if self._mode == "ZTD":
            return abs(z), math.degrees(cmath.phase(z))
        if self._mode == "ZTR":
            return abs(z), cmath.phase(z)
        if self._mode == "LSRS":
            return z.imag / omega, z.real
        y = 1 / z
        return y.imag / omega, abs(y.real / y.imag)

    def _overloads(self, z: complex) -> bool:
        every = self._faults.lcr_overload_every if self._faults else 0
        return abs(z) > self._overload_ohm or (every > 0 and self.readings % every == 0)

    def _misbehave(self) -> None:
        if self._faults is None:
            return
        if 0 < self._faults.lcr_link_lost_after <= self.readings:
            raise LinkLost
        if 0 < self._faults.lcr_silent_after <= self.readings:
            threading.Event().wait(30.0)
            raise LinkLost


def serve_lcr(port: int, *, lift_off_mm: float = 0.5, speed_factor: float = 1.0) -> None:
    """Run a simulated E4980A with a coil over aluminium until Ctrl-C; prints where it listens."""
    meter = LcrSimulator(StillCoil(lift_off_mm), ScaledClock(speed_factor))
    host, bound = meter.start(port)
    print(
        f"simulated E4980A, coil {lift_off_mm:g} mm over aluminium, on TCPIP::{host}::{bound}::SOCKET - Ctrl-C ends it",
        flush=True,
    )
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        print("stopped", flush=True)
    finally:
        meter.close()
