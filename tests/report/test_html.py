"""The page: whole, partial, self-contained."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from example_inspection import whole_inspection, without

from eddyscan.core.errors import GeometryError
from eddyscan.core.technique import Technique
from eddyscan.report import ReportContent, render_html


@pytest.fixture(scope="module")
def page() -> str:
    return render_html(whole_inspection())


def test_names_part_procedure_people_and_numbers(page: str) -> None:
    for text in ("block-a", "EC-017", "A. Writer", "B. Reader", "741", "98.7 %", "0.1.0", "0f" * 32):
        assert text in page


def test_says_that_it_is_a_simulation(page: str) -> None:
    assert '<span class="badge">simulation</span>' in page
    assert "Known only because this was a simulation" in page


def test_fetches_nothing(page: str) -> None:
    own = page.replace(page[page.index("plotly.js v") :], "") if "plotly.js v" in page else page
    assert not re.findall(r"<(?:link|script|img|iframe)[^>]+(?:href|src)=\"(?!data:|#)", page)
    assert not re.findall(r"@import|url\((?!data:|#|&#34;#|\"#)", own)


def test_a_bare_technique_makes_a_report_that_names_what_is_missing() -> None:
    bare = render_html(ReportContent(Technique()))
    for text in ("No views are kept", "No surface was reconstructed", "No plan was made", "Nothing was scanned"):
        assert text in bare
    assert "Plotly" not in bare.split("<script>")[0]
    assert "Against the hidden truth" not in bare


@pytest.mark.parametrize(
    ("field", "said"),
    [
        ("views", "No views are kept"),
        ("nominal", "No nominal surface was given"),
        ("plan", "No plan was made"),
        ("cscan", "No C-scan"),
        ("indications", "The signals were not analysed"),
        ("hashes", "cannot be checked"),
    ],
)
def test_a_missing_part_is_named(field: str, said: str) -> None:
    assert said in render_html(without(whole_inspection(), field))


def test_a_report_without_scan_renders() -> None:
    content = without(whole_inspection(), "record", "lift_off_mm", "residual_ohm", "cscan", "indications")
    assert "Not inspected yet" in render_html(content)


def test_columns_of_another_record_are_refused() -> None:
    with pytest.raises(GeometryError, match="lift_off_mm has 3 entries, the record has 741 readings"):
        dataclasses.replace(whole_inspection(), lift_off_mm=np.zeros(3))


def test_truth_without_simulation_is_refused() -> None:
    with pytest.raises(GeometryError, match="must say so: set simulated=True"):
        ReportContent(Technique(), truth={"rmse_mm": 0.1})


def test_text_from_files_cannot_break_the_page() -> None:
    content = dataclasses.replace(whole_inspection(), notes=("<script>alert(1)</script>",))
    assert "<script>alert(1)" not in render_html(content)
