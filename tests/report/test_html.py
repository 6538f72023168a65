"""The page: whole, partial, self-contained."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from example_inspection import small_inspection, without

from eddyscan.core.errors import GeometryError
from eddyscan.core.technique import Technique
from eddyscan.report import ReportContent, render_html
from eddyscan.report.blocks import Note, Scene
from eddyscan.report.sections import sections


@pytest.fixture(scope="module")
def page() -> str:
    return render_html(small_inspection())


@pytest.fixture(scope="module")
def page_without_viewer(page: str) -> str:
    start = page.index("<script>/**\n* plotly.js") if "<script>/**\n* plotly.js" in page else page.rindex("<script>/*")
    return page[:start] + page[page.index("</script>", start) :]


def test_names_part_procedure_people_and_numbers(page: str) -> None:
    for text in ("block-a", "EC-017", "A. Writer", "B. Reader", "98.7 %", "0.1.0", "0f" * 32, "22 November 2026"):
        assert text in page


def test_says_that_it_is_a_simulation(page: str) -> None:
    assert '<span class="badge">simulation</span>' in page
    assert "Known only because this was a simulation" in page


def test_every_chapter_is_there_and_linked(page: str) -> None:
    for chapter in sections(small_inspection()):
        assert f'<section id="{chapter.key}">' in page
        assert f'<a href="#{chapter.key}">' in page


def test_refers_to_nothing_outside_itself(page_without_viewer: str) -> None:
    links = re.findall(r"<(?:link|script|img|iframe|use|image|a)\b[^>]*?(?:href|src)=\"([^\"]*)", page_without_viewer)
    assert links
    assert [link for link in links if not link.startswith(("#", "data:"))] == []
    assert re.findall(r"@import|url\((?!#|data:)", page_without_viewer) == []


def test_drawings_follow_the_page_colours(page_without_viewer: str) -> None:
    drawings = re.findall(r"<svg.*?</svg>", page_without_viewer, re.DOTALL)
    assert len(drawings) > 10
    assert all(re.match(r'<svg role="img" aria-label="[^"]{10,}"', drawing) for drawing in drawings)
    assert all("var(--muted)" in drawing for drawing in drawings if "<text" in drawing)
    assert not any(re.search(r"#0000(0[a-f]|1a)\b", drawing) for drawing in drawings)


def test_the_same_inspection_gives_the_same_page(page: str) -> None:
    assert render_html(small_inspection()) == page


def test_a_bare_technique_makes_a_report_that_names_what_is_missing() -> None:
    bare = render_html(ReportContent(Technique()))
    for text in ("No views are kept", "No surface was reconstructed", "No plan was made", "Nothing was scanned"):
        assert text in bare
    assert len(bare) < 100_000
    assert "Against the hidden truth" not in bare


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        (("views",), "No views are kept"),
        (("nominal",), "No nominal surface was given"),
        (("mesh", "nominal"), "No surface was reconstructed"),
        (("plan",), "No plan was made"),
        (("cscan",), "No C-scan"),
        (("indications",), "The signals were not analysed"),
        (("hashes",), "cannot be checked"),
        (("record", "lift_off_mm", "residual_ohm", "cscan", "indications"), "Nothing was scanned"),
    ],
)
def test_a_missing_part_is_named_in_its_chapter(fields: tuple[str, ...], said: str) -> None:
    chapters = sections(without(small_inspection(), *fields))
    missing = [block.text for chapter in chapters for block in chapter.blocks if isinstance(block, Note)]
    assert any(said in text for text in missing)
    whole = [
        block.text for chapter in sections(small_inspection()) for block in chapter.blocks if isinstance(block, Note)
    ]
    assert not any(said in text for text in whole)


def test_a_record_of_readings_without_value_still_renders() -> None:
    content = small_inspection()
    assert content.record is not None
    nothing = dataclasses.replace(content.record, impedance_ohm=np.full(len(content.record), np.nan + 0j))
    empty = np.full(len(nothing), np.nan)
    dead = dataclasses.replace(
        without(content, "cscan", "views", "mesh", "nominal"),
        record=nothing,
        lift_off_mm=empty,
        residual_ohm=empty + 0j,
        indications=(),
    )
    assert "No indication in the examined area" in render_html(dead)


def test_text_from_files_cannot_break_the_page() -> None:
    hostile = "</script><script>alert(1)</script>"
    content = dataclasses.replace(ReportContent(Technique()), notes=(hostile,), hashes={hostile: hostile})
    assert "<script>alert(1)" not in render_html(content)
    scene = next(b for c in sections(small_inspection()) for b in c.blocks if isinstance(b, Scene))
    assert "</script" not in scene.figure_json


def test_columns_of_another_record_are_refused() -> None:
    with pytest.raises(GeometryError, match=r"lift_off_mm has 3 entries, the record has \d+ readings"):
        dataclasses.replace(small_inspection(), lift_off_mm=np.zeros(3))


def test_truth_without_simulation_is_refused() -> None:
    with pytest.raises(GeometryError, match="must say so: set simulated=True"):
        ReportContent(Technique(), truth={"rmse_mm": 0.1})
