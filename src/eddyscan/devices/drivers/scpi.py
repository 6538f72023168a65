"""Any instrument that answers text over VISA, described by a few lines of rig.toml.

    [instrument]
    driver = "eddyscan.devices.drivers.scpi:ScpiInstrument"
    address = "TCPIP::192.168.0.10::5025::SOCKET"
    [instrument.options]
    expect = "E4980A"
    setup = ["FUNC:IMP RX", "TRIG:SOUR BUS"]
    frequency = "FREQ {frequency_hz:g}"
    level = "VOLT {level_v:g}"
    read = "*TRG"
    form = "ohm"
    status_index = 2
    overload_status = [1]
    range_hz = [20, 2e6]

Unverified on hardware by nature: what it drives is up to the lab.
"""

from __future__ import annotations

import cmath
import math
from typing import Literal

from pydantic import Field, model_validator

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OK, OUT_OF_RANGE, OVERLOAD
from eddyscan.core.technique import Drive, Section
from eddyscan.devices.drivers.scpi_link import open_visa_session, parsed_values
from eddyscan.devices.protocols import Clock, Identity, ImpedanceReading


class ScpiSettings(Section):
    """The instrument in its own words."""

    address: str = Field("TCPIP::192.168.0.10::5025::SOCKET", description="VISA resource name")
    expect: str = Field("", description="must occur in the answer to the identity query")
    identity: str = "*IDN?"
    setup: tuple[str, ...] = Field((), description="commands once after connecting")
    frequency: str = Field("FREQ {frequency_hz:g}", description="command with {frequency_hz}")
    level: str = Field("", description="command with {level_v}; empty: not set")
    frequency_query: str = Field("", description="reads the frequency back; empty: not checked")
    error_query: str = Field("", description="answers 0 when nothing is wrong; empty: not asked")
    read: str = Field("*TRG", description="query that takes and returns a reading")
    form: Literal["ohm", "ohm-deg", "ohm-rad", "henry-ohm"] = Field(
        "ohm", description="R and X; |Z| and phase; or series L and R"
    )
    first_index: int = Field(0, ge=0, description="place of the first number in the answer, from 0")
    status_index: int | None = Field(None, ge=0, description="place of a status number")
    overload_status: tuple[int, ...] = Field((1,), description="status numbers that mean overload; 0 is good")
    range_hz: tuple[float, float] = Field((1.0, 10e6), description="frequencies the instrument can do")
    timing: Literal["triggered", "free"] = Field("triggered", description="free: stamped earlier by delay_s")
    delay_s: float = Field(0.0, ge=0, description="age of a free-running reading, s")
    timeout_s: float = Field(10.0, gt=0, le=120, description="wall time without answer: link lost, s")

    @model_validator(mode="after")
    def _texts_can_be_filled(self) -> ScpiSettings:
        for key, text in (("frequency", self.frequency), ("level", self.level)):
            try:
                text.format(frequency_hz=1.0, level_v=1.0)
            except (KeyError, IndexError, ValueError) as fault:
                raise ValueError(f"{key} = {text!r} cannot be filled with frequency_hz and level_v: {fault}") from None
        return self


class ScpiInstrument:
    """Sends the lab's own lines and reads numbers; implements `EddyInstrument`."""

    def __init__(self, settings: ScpiSettings, clock: Clock) -> None:
        self.settings, self._clock = settings, clock
        self._drive: Drive | None = None
        self._link = open_visa_session(settings.address, settings.timeout_s)
        try:
            with self._link.guarded("connect"):
                said = self._link.ask(settings.identity)
                for command in settings.setup:
                    self._link.adapter.write(command)
            if settings.expect not in said:
                raise LinkError(
                    f"the device at {settings.address} says it is {said!r}; expected was {settings.expect!r}. "
                    "Check [instrument] address and expect in rig.toml."
                )
            self._refuse_errors("set up")
        except BaseException:
            self._link.close()
            raise
        words = [word.strip() for word in said.split(",")] + ["", "", "", ""]
        self._identity = Identity("scpi instrument", f"{words[0]} {words[1]}".strip(), words[2], words[3])

    def identity(self) -> Identity:
        """Return what the instrument said it is."""
        return self._identity

    def configure(self, drive: Drive) -> None:
        """Send frequency and level, and read the frequency back when a query is given.

        Raises
        ------
        TechniqueError
            When the frequency is outside `range_hz`.
        DeviceError
            When the instrument reports an error or keeps another frequency.
        """
        s = self.settings
        if not s.range_hz[0] <= drive.frequency_hz <= s.range_hz[1]:
            raise TechniqueError(
                f"frequency_hz = {drive.frequency_hz:g} is outside the instrument's {s.range_hz[0]:g} to "
                f"{s.range_hz[1]:g} Hz (range_hz in rig.toml). Choose one inside."
            )
        with self._link.guarded("configure"):
            for text in filter(None, (s.frequency, s.level)):
                self._link.adapter.write(text.format(frequency_hz=drive.frequency_hz, level_v=drive.level_v))
        self._refuse_errors("be configured")
        if s.frequency_query:
            with self._link.guarded("configure"):
                kept = parsed_values(self._link.ask(s.frequency_query), 1, s.address)[0]
            if not math.isclose(kept, drive.frequency_hz, rel_tol=1e-4):
                raise DeviceError(
                    f"the instrument at {s.address} keeps {kept:g} Hz, asked for was {drive.frequency_hz:g} Hz. "
                    "Check frequency in rig.toml [instrument.options]."
                )
        self._drive = drive

    def read(self) -> ImpedanceReading:
        """Take one reading, stamped with the middle of its time, less its age when free-running.

        Raises
        ------
        DeviceError
            Before `configure`.
        LinkError
            When there is no answer or it holds no reading.
        """
        if self._drive is None:
            raise DeviceError("the instrument has no drive yet; configure it before the first reading.")
        s = self.settings
        before = self._clock.now()
        with self._link.guarded("read"):
            answer = self._link.ask(s.read)
        time_s = 0.5 * (before + self._clock.now()) - (s.delay_s if s.timing == "free" else 0.0)
        values = parsed_values(answer, max(s.first_index + 1, s.status_index or 0) + 1, s.address)
        z = _impedance_ohm(values[s.first_index], values[s.first_index + 1], s.form, self._drive.frequency_hz)
        return ImpedanceReading(z, time_s, self._flag(values))

    def close(self) -> None:
        """Close the link; again: nothing."""
        self._link.close()

    def _flag(self, values: list[float]) -> int:
        if self.settings.status_index is None:
            return OK
        status = int(values[self.settings.status_index])
        if status in self.settings.overload_status:
            return OVERLOAD
        return OK if status == 0 else OUT_OF_RANGE

    def _refuse_errors(self, doing: str) -> None:
        if self.settings.error_query:
            with self._link.guarded(doing):
                error = self._link.ask(self.settings.error_query)
            if error.split(",")[0].strip() not in ("0", "+0"):
                raise DeviceError(
                    f"the instrument at {self.settings.address} refuses to {doing}: {error}. "
                    "Check its lines in rig.toml [instrument.options]."
                )


def _impedance_ohm(first: float, second: float, form: str, frequency_hz: float) -> complex:
    if form == "ohm":
        return complex(first, second)
    if form == "henry-ohm":
        return complex(second, 2 * math.pi * frequency_hz * first)
    return cmath.rect(first, math.radians(second) if form == "ohm-deg" else second)
