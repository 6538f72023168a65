"""Keysight (Agilent) E4980A/AL precision LCR meter, through PyMeasure over VISA.

Unverified on hardware: it runs with the real PyMeasure and pyvisa-py against
the simulated meter.
"""

from __future__ import annotations

import math
import warnings
from typing import Any, Literal

from pydantic import Field

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OK, OUT_OF_RANGE, OVERLOAD
from eddyscan.core.technique import Drive, Section
from eddyscan.devices.drivers.scpi_link import open_visa_session, parsed_values
from eddyscan.devices.protocols import Clock, Identity, ImpedanceReading

LOWEST_HZ, HIGHEST_HZ = 20.0, 2e6
HIGHEST_V = 20.0
STATUS_FLAGS = {0: OK, 1: OVERLOAD}
MOST_ERRORS = 20


class KeysightE4980ASettings(Section):
    """How to reach the meter and how it reads."""

    address: str = Field("TCPIP::192.168.0.10::5025::SOCKET", description="VISA resource name")
    aperture: Literal["SHORT", "MED", "LONG"] = "SHORT"
    averages: int = Field(1, ge=1, le=256)
    timeout_s: float = Field(10.0, gt=0, le=120, description="wall time without answer: link lost, s")


class KeysightE4980A:
    """Bus-triggered readings of resistance and reactance; implements `EddyInstrument`.

    Raises
    ------
    LinkError
        When nobody answers at the address, or something else than an E4980A does.
    """

    def __init__(self, settings: KeysightE4980ASettings, clock: Clock) -> None:
        self.settings, self._clock = settings, clock
        self._link = open_visa_session(settings.address, settings.timeout_s)
        try:
            with self._link.guarded("connect"):
                self._meter = _pymeasure_meter(self._link.adapter)
                self._prepare()
        except BaseException:
            self._link.close()
            raise

    def identity(self) -> Identity:
        """Return what the meter said it is."""
        return self._identity

    def configure(self, drive: Drive) -> None:
        """Set frequency and level, and read them back.

        Raises
        ------
        TechniqueError
            When frequency or level is outside the meter's range.
        DeviceError
            When the meter refuses or keeps another value.
        """
        if not LOWEST_HZ <= drive.frequency_hz <= HIGHEST_HZ:
            raise TechniqueError(
                f"frequency_hz = {drive.frequency_hz:g} is outside the E4980A's {LOWEST_HZ:g} to {HIGHEST_HZ:g} Hz. "
                "Choose one inside, or another instrument."
            )
        if drive.level_v > HIGHEST_V:
            raise TechniqueError(f"level_v = {drive.level_v:g} is above the E4980A's {HIGHEST_V:g} V. Lower it.")
        with self._link.guarded("configure"):
            self._meter.frequency = drive.frequency_hz
            self._meter.ac_voltage = drive.level_v
            kept = float(self._meter.frequency)
        self._refuse_errors()
        if not math.isclose(kept, drive.frequency_hz, rel_tol=1e-4):
            raise DeviceError(
                f"the E4980A at {self.settings.address} keeps {kept:g} Hz, "
                f"asked for was {drive.frequency_hz:g} Hz. Check its options."
            )

    def read(self) -> ImpedanceReading:
        """Trigger one reading and return it, stamped with the middle of its time.

        Raises
        ------
        LinkError
            When the meter does not answer or its answer is no reading.
        """
        before = self._clock.now()
        with self._link.guarded("read"):
            answer = self._link.ask("*TRG")
        time_s = 0.5 * (before + self._clock.now())
        resistance, reactance, status = parsed_values(answer, 3, self.settings.address)
        return ImpedanceReading(complex(resistance, reactance), time_s, STATUS_FLAGS.get(int(status), OUT_OF_RANGE))

    def close(self) -> None:
        """Close the link; again: nothing."""
        self._link.close()

    def _prepare(self) -> None:
        self._link.set_timeout(self.settings.timeout_s)
        self._identity = self._read_identity()
        self._meter.write("*CLS")
        self._meter.mode = "RX"
        self._meter.aperture(self.settings.aperture, self.settings.averages)
        self._meter.trigger_source = "BUS"
        self._meter.write("INIT:CONT ON")

    def _read_identity(self) -> Identity:
        said = [word.strip() for word in self._link.ask("*IDN?").split(",")]
        if len(said) < 4 or not said[1].startswith("E4980A"):
            raise LinkError(
                f"the device at {self.settings.address} says it is {', '.join(said)!r}, not an E4980A. "
                "Check [instrument] address and driver in rig.toml."
            )
        return Identity("impedance meter", f"{said[0]} {said[1]}", said[2], said[3], verified=False)

    def _refuse_errors(self) -> None:
        with self._link.guarded("configure"):
            for _ in range(MOST_ERRORS):
                error = self._link.ask("SYST:ERR?")
                if error.startswith(("+0", "0")):
                    return
                raise DeviceError(f"the E4980A at {self.settings.address} refuses: {error}. Check [drive].")


def _pymeasure_meter(adapter: Any) -> Any:
    """Return PyMeasure's instrument; it warns of itself that nobody told it the meter speaks SCPI, which it does."""
    from pymeasure.instruments.agilent import AgilentE4980

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="It is not known whether", category=FutureWarning)
        return AgilentE4980(adapter)
