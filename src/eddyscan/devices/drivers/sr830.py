"""Stanford Research lock-in amplifiers SR830 and SR860 as impedance meters, through PyMeasure.

The sine output drives the coil through a series resistor; the lock-in measures
the voltage across the coil. With the drive V, the total resistance R before the
coil (source and resistor) and the measured complex voltage U:

    Z = R * (U / V) / (1 - U / V)          (a voltage divider)

Unverified on hardware: runs with the real PyMeasure against the simulated lock-in.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

from pydantic import Field

from eddyscan.core.errors import DeviceError, LinkError, TechniqueError
from eddyscan.core.record import OK, OUT_OF_RANGE, OVERLOAD
from eddyscan.core.technique import Drive, Section
from eddyscan.devices.drivers.scpi_link import open_visa_session, parsed_values
from eddyscan.devices.protocols import Clock, Identity, ImpedanceReading

SOURCE_OHM = 50.0
OVERLOAD_BITS = 0b0111  # input, filter, output: the manual's LIA status byte
UNLOCKED_BIT = 0b1000


class LockInSettings(Section):
    """How the lock-in is reached and wired."""

    address: str = Field("ASRL/dev/ttyUSB0::INSTR", description="VISA resource name")
    series_ohm: float = Field(1000.0, gt=0, description="resistor between sine output and coil, ohm")
    sensitivity_v: float = Field(0.05, gt=0, le=1.0, description="full scale, one of the instrument's steps, V")
    time_constant_s: float = Field(1e-3, gt=0, description="of the output filter, one of the instrument's steps, s")
    slope_db_octave: Literal[6, 12, 18, 24] = 12
    timing: Literal["settled", "free"] = Field("settled", description="wait for the filter, or read as it runs")
    settle_time_constants: float = Field(12.0, ge=0, le=100, description="wait before a settled reading")
    timeout_s: float = Field(10.0, gt=0, le=120, description="wall time without answer: link lost, s")


class SR830:
    """The SR830 up to 102 kHz; implements `EddyInstrument`.

    Raises
    ------
    LinkError
        When nobody answers at the address, or something else does.
    """

    model: ClassVar[str] = "SR830"
    highest_hz: ClassVar[float] = 102e3
    level_v: ClassVar[tuple[float, float]] = (0.004, 5.0)
    overload_query: ClassVar[str] = "LIAS?"

    def __init__(self, settings: LockInSettings, clock: Clock) -> None:
        self.settings, self._clock = settings, clock
        self._drive: Drive | None = None
        self._link = open_visa_session(settings.address, settings.timeout_s)
        try:
            with self._link.guarded("connect"):
                self._lock_in = self._pymeasure(self._link.adapter)
                self._link.set_timeout(settings.timeout_s)
                self._identity = self._read_identity()
                self._lock_in.write("*CLS")
                self._set_filter()
        except BaseException:
            self._link.close()
            raise

    def identity(self) -> Identity:
        """Return what the lock-in said it is, and how it is wired."""
        return self._identity

    def configure(self, drive: Drive) -> None:
        """Set the sine output and read its frequency back.

        Raises
        ------
        TechniqueError
            When frequency or level is outside the lock-in's range: PyMeasure would clip it in silence.
        DeviceError
            When it keeps another frequency.
        """
        low, high = self.level_v
        if not 1.0 <= drive.frequency_hz <= self.highest_hz:
            raise TechniqueError(
                f"frequency_hz = {drive.frequency_hz:g} is outside the {self.model}'s 1 to {self.highest_hz:g} Hz. "
                "Choose one inside, or another instrument."
            )
        if not low <= drive.level_v <= high:
            raise TechniqueError(f"level_v = {drive.level_v:g} is outside the {self.model}'s {low:g} to {high:g} V.")
        with self._link.guarded("configure"):
            self._lock_in.frequency = drive.frequency_hz
            self._lock_in.sine_voltage = drive.level_v
            kept = float(self._lock_in.frequency)
            self._link.ask(self.overload_query)
        if abs(kept - drive.frequency_hz) > 1e-4 * drive.frequency_hz:
            raise DeviceError(
                f"the {self.model} at {self.settings.address} keeps {kept:g} Hz, asked for was "
                f"{drive.frequency_hz:g} Hz. Set its reference to internal."
            )
        self._drive = drive

    def read(self) -> ImpedanceReading:
        """Return one reading; a free-running one is stamped earlier by the filter's delay.

        Raises
        ------
        DeviceError
            Before `configure`.
        LinkError
            When the lock-in does not answer or its answer is no reading.
        """
        if self._drive is None:
            raise DeviceError(f"the {self.model} has no drive yet; configure it before the first reading.")
        tau = self.settings.time_constant_s
        if self.settings.timing == "settled":
            self._clock.sleep(self.settings.settle_time_constants * tau)
        before = self._clock.now()
        with self._link.guarded("read"):
            answer = self._link.ask(self._snap_command())
            status = int(float(self._link.ask(self.overload_query)))
        delay_s = 0.0 if self.settings.timing == "settled" else tau * self.settings.slope_db_octave / 6
        time_s = 0.5 * (before + self._clock.now()) - delay_s
        x, y = parsed_values(answer, 2, self.settings.address)
        return ImpedanceReading(self._impedance_ohm(complex(x, y)), time_s, self._flag(status))

    def close(self) -> None:
        """Close the link; again: nothing."""
        self._link.close()

    def _impedance_ohm(self, voltage: complex) -> complex:
        assert self._drive is not None
        ratio = voltage / self._drive.level_v
        return (self.settings.series_ohm + SOURCE_OHM) * ratio / (1 - ratio)

    def _flag(self, status: int) -> int:
        if status & OVERLOAD_BITS:
            return OVERLOAD
        return OUT_OF_RANGE if status & UNLOCKED_BIT else OK

    def _pymeasure(self, adapter: Any) -> Any:
        from pymeasure.instruments.srs import SR830 as PyMeasureSR830

        return PyMeasureSR830(adapter)

    def _snap_command(self) -> str:
        return "SNAP? 1,2"

    def _set_filter(self) -> None:
        s = self.settings
        self._require_step("sensitivity_v", s.sensitivity_v, self._lock_in.SENSITIVITIES)
        self._require_step("time_constant_s", s.time_constant_s, self._lock_in.TIME_CONSTANTS)
        self._lock_in.sensitivity = s.sensitivity_v
        self._lock_in.time_constant = s.time_constant_s
        self._set_slope()

    def _set_slope(self) -> None:
        self._lock_in.filter_slope = self.settings.slope_db_octave

    def _require_step(self, key: str, value: float, steps: list[float]) -> None:
        if value not in steps:
            nearest = min(steps, key=lambda step: abs(step - value))
            raise TechniqueError(
                f"{key} = {value:g} is no step of the {self.model}; the nearest is {nearest:g}. "
                "Give it in rig.toml [instrument] options."
            )

    def _read_identity(self) -> Identity:
        said = [word.strip() for word in self._link.ask("*IDN?").split(",")]
        if len(said) < 4 or said[1] != self.model:
            raise LinkError(
                f"the device at {self.settings.address} says it is {', '.join(said)!r}, not an {self.model}. "
                "Check [instrument] address and driver in rig.toml."
            )
        wiring = (("series_ohm", f"{self.settings.series_ohm:g}"), ("timing", self.settings.timing))
        return Identity("lock-in amplifier", f"{said[0]} {said[1]}", said[2], said[3], verified=False, settings=wiring)


class SR860(SR830):
    """The SR860 up to 500 kHz: other steps, other names for the same things.

    Its overload register CUROVLDSTAT? is used as remembered from the manual; check it on the instrument.
    """

    model: ClassVar[str] = "SR860"
    highest_hz: ClassVar[float] = 500e3
    level_v: ClassVar[tuple[float, float]] = (1e-9, 2.0)
    overload_query: ClassVar[str] = "CUROVLDSTAT?"

    def _pymeasure(self, adapter: Any) -> Any:
        from pymeasure.instruments.srs import SR860 as PyMeasureSR860

        return PyMeasureSR860(adapter)

    def _snap_command(self) -> str:
        return "SNAP? 0,1"

    def _set_slope(self) -> None:
        self._lock_in.filter_slope = self.settings.slope_db_octave // 6 - 1

    def _flag(self, status: int) -> int:
        return OVERLOAD if status else OK
