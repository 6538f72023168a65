"""The report on paper: all words are there, nothing runs off a sheet."""

from __future__ import annotations

import re
import zlib

import pytest
from example_inspection import small_inspection
from hypothesis import given, settings
from hypothesis import strategies as st

from eddyscan.core.technique import Technique
from eddyscan.report import ReportContent, render_pdf
from eddyscan.report.paper import FOOT_PT, HEIGHT_PT, MARGIN_PT, WIDTH_PT, Paper
from eddyscan.report.paper_text import column_widths, width_pt, wrapped
from eddyscan.report.pdf import sheets_of
from eddyscan.report.sections import sections


@pytest.fixture(scope="module")
def sheets() -> list:
    return sheets_of(small_inspection())


def words_of(sheets: list) -> str:
    return " ".join(text.get_text() for sheet in sheets for text in sheet.texts)


def test_every_chapter_and_the_people_are_on_paper(sheets: list) -> None:
    words = words_of(sheets)
    for chapter in sections(small_inspection()):
        assert chapter.title in words
    for text in ("Operator · A. Writer, level 2", "Reviewer · B. Reader", "Date and signature", "simulation"):
        assert text in words


def test_sheets_are_numbered(sheets: list) -> None:
    for number, sheet in enumerate(sheets, start=1):
        assert any(f"page {number} of {len(sheets)}" in text.get_text() for text in sheet.texts)


def test_no_word_and_no_picture_leaves_its_sheet(sheets: list) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.transforms import Affine2D

    for sheet in sheets:
        sheet.set_dpi(288)  # fine enough that hinting to whole pixels does not widen the lines
        renderer = FigureCanvasAgg(sheet).get_renderer()
        for text in sheet.texts:
            box = text.get_window_extent(renderer, dpi=288).transformed(Affine2D().scale(0.25))
            assert box.x0 >= MARGIN_PT - 1, text.get_text()
            assert box.x1 <= WIDTH_PT - MARGIN_PT + 1, text.get_text()
            assert box.y0 >= 20, text.get_text()
        for axes in sheet.axes:
            assert axes.get_position().y0 * HEIGHT_PT >= FOOT_PT - 1


def test_the_file_is_a_pdf_with_text_and_as_many_pages() -> None:
    content = ReportContent(Technique())
    data = render_pdf(content)
    assert data.startswith(b"%PDF-")
    assert data.rstrip().endswith(b"%%EOF")
    pages = int(re.search(rb"/Type /Pages.*?/Count (\d+)", data, re.DOTALL).group(1))  # type: ignore[union-attr]
    assert pages == len(sheets_of(content))
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
    unpacked = b"".join(zlib.decompress(s) for s in streams if s[:1] == b"\x78")
    assert b"Tj" in unpacked or b"TJ" in unpacked


def test_the_same_content_gives_the_same_file() -> None:
    content = ReportContent(Technique())
    assert render_pdf(content) == render_pdf(content)


def test_a_new_sheet_opens_only_when_needed() -> None:
    paper = Paper("foot")
    assert not paper.need(100)
    paper.skip(HEIGHT_PT - MARGIN_PT - FOOT_PT - 50)
    assert paper.need(100)
    assert len(paper.sheets) == 2


@settings(deadline=None)
@given(st.text(st.characters(min_codepoint=33, max_codepoint=126) | st.just(" "), max_size=80), st.floats(20, 300))
def test_wrapped_lines_fit_and_lose_nothing(text: str, room_pt: float) -> None:
    lines = wrapped(text, room_pt, 9.0)
    assert "".join(lines).replace(" ", "") == "".join(text.split())
    assert all(width_pt(line, 9.0) <= room_pt or len(line) == 1 for line in lines)


def test_columns_fill_the_room_and_short_ones_keep_what_they_need() -> None:
    widths = column_widths(("no.", "reason"), (("1", "a very long reason " * 20),), 400.0, 8.0)
    assert sum(widths) == pytest.approx(400.0)
    assert widths[0] >= width_pt("no.", 8.0)
    assert widths[0] < 60
