import dataclasses

import numpy as np
import pytest

from eddyscan.core.errors import DeviceError, GeometryError, LinkError, TechniqueError
from eddyscan.core.technique import Technique
from eddyscan.devices.clock import VirtualClock
from eddyscan.devices.protocols import ImpedanceReading
from eddyscan.devices.sim.world_settings import WorldReference, WorldSettings
from eddyscan.scanning.field_motion import FieldProbe
from eddyscan.scanning.reference_checks import (
    ReferenceBlock,
    compared,
    drift_ohm_per_hour,
    not_examined,
    run_reference,
    warm_up,
)

from .field_cell import FieldCell

SETTINGS = WorldSettings(part="plate", flaws="none", reference=WorldReference(notch_depths_mm=(0.5,)))
BLOCK = ReferenceBlock.evenly(SETTINGS.reference.corner_mm, SETTINGS.reference.size_mm, (0.5,), "B-1")


def run(cell, when, block=BLOCK):
    air = cell.probe.air_ohm(500e3) + SETTINGS.instrument.wire_resistance_ohm
    return run_reference(block, Technique(), stage=cell, instrument=cell, clock=cell.clock, air_ohm=air, when=when)


@pytest.fixture(scope="module")
def cell():
    return FieldCell(SETTINGS, VirtualClock())


@pytest.fixture(scope="module")
def before(cell):
    return run(cell, "before")


def test_the_notch_answers_the_same_before_and_after(cell, before):
    cell.clock.sleep(600.0)
    after = compared(before, run(cell, "after"))
    assert after.passed
    assert abs(after.responses[0].change) < 0.05
    assert before.responses[0].snr > 30
    assert not_examined([before, after]) == []
    assert abs(drift_ohm_per_hour(before, after)) < 0.2
    entry = after.as_entries()[0]
    assert entry["notch_depth_mm"] == 0.5
    assert entry["passed"] is True
    assert cell.at[2] == cell.axes()[2].upper


def test_a_changed_amplitude_fails_and_voids_what_was_scanned_since(before):
    weak = dataclasses.replace(before.responses[0], amplitude_ohm=0.8 * before.responses[0].amplitude_ohm)
    late = dataclasses.replace(before, when="after", time_s=before.time_s + 900, responses=(weak,))
    judged = compared(before, late)
    assert not judged.passed
    assert "amplitude changed by -20 % (limit 10 %)" in judged.responses[0].reason
    assert not_examined([judged, before]) == [(before.time_s, judged.time_s)]


def test_no_block_where_it_should_be(cell):
    away = dataclasses.replace(BLOCK, corner_mm=(30.0, 170.0, 12.0))
    far = FieldCell(SETTINGS.model_copy(update={"part": "dome"}), VirtualClock())
    with pytest.raises(GeometryError, match="no metal under x ="):
        run(far, "before", away)
    assert far.stops == 1


def test_a_lost_link_lifts_the_probe():
    cell = FieldCell(SETTINGS, VirtualClock())

    def dead():
        raise LinkError("no answer")

    cell.read = dead
    with pytest.raises(LinkError):
        run(cell, "before")
    assert cell.at[2] == cell.axes()[2].upper


def test_warm_up_waits_for_a_steady_reading():
    cell = FieldCell(SETTINGS, VirtualClock())
    cell.configure(Technique().drive)
    probe = FieldProbe(cell, cell, cell.clock, Technique())
    cell.read = lambda: ImpedanceReading(40j * (1 + 0.05 * np.exp(-cell.clock.now() / 60.0)), cell.clock.now())
    waited, drift = warm_up(probe)
    assert 100 < waited < 600
    assert drift < 1e-3
    cell.read = lambda: ImpedanceReading(40j * (1 + 1e-4 * cell.clock.now()), cell.clock.now())
    with pytest.raises(DeviceError, match=r"still drifts by .* % per minute after 300 s of warm-up \(limit"):
        warm_up(probe, longest_s=300.0)


def test_a_block_needs_a_depth_for_every_notch():
    with pytest.raises(TechniqueError, match="2 notch places and 1 depths"):
        ReferenceBlock((0, 0, 0), 80, 16, (10.0, 20.0), (0.5,))
