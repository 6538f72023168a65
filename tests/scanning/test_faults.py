"""The short form of the fault campaign that `make faults` runs in full."""

import pytest

from benchmarks.fault_campaign import kill_campaign, link_campaign
from tests.devices.zaber_cell import private_store


@pytest.fixture(autouse=True)
def store(tmp_path):
    private_store(tmp_path)


@pytest.mark.parametrize("mode", ["step", "row", "pvt"])
def test_faults_on_the_line_and_in_the_stage_lose_nothing(tmp_path, mode):
    outcome = link_campaign(5, 7, tmp_path, (mode,))
    assert outcome.clean(), outcome
    assert outcome.finished >= 1
    assert sum(outcome.told.values()) >= 1


@pytest.mark.slow
def test_a_killed_scan_loses_nothing_and_leaves_the_axes_at_rest(tmp_path):
    outcome = kill_campaign(2, 11, tmp_path, ("row",))
    assert outcome.clean(), outcome
    assert outcome.faults == 2
    assert outcome.finished == 1
