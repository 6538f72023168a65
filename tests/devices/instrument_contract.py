"""The promises of every eddy-current instrument: one suite, run on each driver with its simulator.

A driver's test module derives from `InstrumentContract` and supplies the
fixtures `instrument` (connected) and `true_ohm` (what its coil has, wire
included, at 100 kHz), and says how exact the simulated reading is.
"""

import math

import pytest

from eddyscan.core.errors import EddyscanError
from eddyscan.core.record import OK
from eddyscan.core.technique import Drive
from eddyscan.devices.protocols import EddyInstrument

DRIVE = Drive(frequency_hz=100e3, level_v=1.0)


class InstrumentContract:
    """Tests only; no instrument of its own."""

    exactness = 1e-3

    @pytest.fixture
    def configured(self, instrument: EddyInstrument) -> EddyInstrument:
        instrument.configure(DRIVE)
        return instrument

    def test_it_is_an_instrument(self, instrument):
        assert isinstance(instrument, EddyInstrument)

    def test_identity_says_who_answered_and_whether_hardware_was_tried(self, instrument):
        identity = instrument.identity()
        assert identity.kind
        assert identity.model
        assert identity.verified in (True, False)

    def test_reading_is_the_coils_impedance_in_ohms_unrotated(self, configured, true_ohm):
        z = configured.read().impedance_ohm
        assert abs(z - true_ohm) < self.exactness * abs(true_ohm)

    def test_good_reading_carries_no_flag(self, configured):
        assert configured.read().flag == OK

    def test_readings_are_stamped_in_order(self, configured):
        times = [configured.read().time_s for _ in range(5)]
        assert all(math.isfinite(time) for time in times)
        assert times == sorted(times)

    def test_reading_again_measures_again(self, configured):
        readings = [configured.read().impedance_ohm for _ in range(4)]
        assert len(set(readings)) > 1

    def test_frequency_beyond_the_instrument_is_refused_with_its_range(self, instrument):
        with pytest.raises(EddyscanError, match=r"1.*e\+07.*Hz"):
            instrument.configure(Drive(frequency_hz=15e6, level_v=1.0))

    def test_reconfiguring_changes_what_is_read(self, configured):
        low = configured.read().impedance_ohm
        configured.configure(Drive(frequency_hz=50e3, level_v=1.0))
        assert configured.read().impedance_ohm.imag < 0.7 * low.imag

    def test_closing_twice_is_harmless(self, instrument):
        instrument.close()
        instrument.close()
