"""A record in pieces says what it says in one."""

from __future__ import annotations

import numpy as np
import pytest

from eddyscan.analysis import analyse
from eddyscan.campaign.blocks import analyse_in_blocks, in_pieces
from eddyscan.campaign.library import build_library
from eddyscan.campaign.signal_case import FlatField, SignalShared
from eddyscan.campaign.values import SignalValues
from eddyscan.core.errors import InputError
from eddyscan.core.record import ScanRecord
from eddyscan.core.technique import Technique
from eddyscan.physics import Conductor
from eddyscan.physics.sound_response import technique_coil

FREQUENCY_HZ = 500e3


@pytest.fixture
def field(small_tables: None) -> tuple[FlatField, ScanRecord, Technique]:
    technique = Technique()
    library = build_library(
        technique_coil(technique),
        Conductor.half_space(technique.part.conductivity_ms_m),
        FREQUENCY_HZ,
        opening_mm=0.1,
        lengths_mm=(3.0, 3.0),
        depths_mm=(1.0, 1.0),
        largest_lift_off_mm=0.4,
    )
    values = SignalValues(flaw_length_mm=3.0, flaw_depth_mm=1.0, field_mm=60.0, pitch_mm=1.0, step_mm=1.0)
    raster = FlatField({"case": 0, "seed": 4, **values.model_dump()}, np.random.default_rng(4))
    technique = raster.technique(technique)
    return raster, raster.record(SignalShared(technique, {(FREQUENCY_HZ, 0.1): library}), technique), technique


def test_pieces_give_the_same_cscan_and_indications(field: tuple[FlatField, ScanRecord, Technique]) -> None:
    raster, record, technique = field
    whole = analyse(record, raster.mesh(), technique)
    blocks = analyse_in_blocks(in_pieces(record, rows=15), raster.mesh(), technique)
    assert (blocks.readings, blocks.pieces) == (len(record), 5)
    np.testing.assert_array_equal(blocks.cscan.covered, whole.cscan.covered)
    for name in ("lift_off_mm", "amplitude_ohm"):
        np.testing.assert_allclose(blocks.cscan.channels[name], whole.cscan.channels[name], rtol=1e-6)
    # Noise is judged per piece, so scores agree within its own uncertainty.
    both = whole.cscan.channels["score"] > technique.analysis.threshold_mad
    assert both.any()
    np.testing.assert_allclose(blocks.cscan.channels["score"][both], whole.cscan.channels["score"][both], rtol=0.2)
    assert [found.number for found in blocks.indications] == [1]
    np.testing.assert_allclose(blocks.indications[0].centre_mm, whole.indications[0].centre_mm, atol=0.3)


def test_one_piece_is_the_plain_analysis(field: tuple[FlatField, ScanRecord, Technique]) -> None:
    raster, record, technique = field
    whole, blocks = analyse(record, raster.mesh(), technique), analyse_in_blocks([record], raster.mesh(), technique)
    for name, values in whole.cscan.channels.items():
        np.testing.assert_array_equal(blocks.cscan.channels[name], values)
    assert blocks.indications == whole.indications


def test_bad_pieces_are_named(field: tuple[FlatField, ScanRecord, Technique]) -> None:
    raster, record, technique = field
    with pytest.raises(InputError, match="there is no piece of a record to analyse"):
        analyse_in_blocks([], raster.mesh(), technique)
    with pytest.raises(InputError, match="row 0 is cut between two pieces"):
        analyse_in_blocks([next(in_pieces(record, rows=1))] * 2, raster.mesh(), technique)
