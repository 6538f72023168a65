"""The report on paper: the same chapters as the page, as a PDF of A4 sheets."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.report.blocks import Block, Chart, Facts, Gallery, Note, Scene, Signatures, Table
from eddyscan.report.content import ReportContent
from eddyscan.report.headline import headline
from eddyscan.report.paper import ROOM_PT, Paper, Pixels
from eddyscan.report.paper_text import column_widths, wrapped
from eddyscan.report.sections import sections
from eddyscan.report.theme import PAPER, Theme, drawn, settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 170
TEXT_PT, SMALL_PT = 9.0, 7.5
_ROOM_PT: dict[type, float] = {Chart: 260.0, Scene: 300.0, Gallery: 170.0, Signatures: 100.0}
COLOURS = {"missing": PAPER.muted, "warning": PAPER.second, "good": PAPER.accent, "plain": PAPER.ink}


def render_pdf(content: ReportContent) -> bytes:
    """Return the whole report as a PDF; drawings are pictures, all words can be searched."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_pdf import PdfPages

    data = io.BytesIO()
    title = f"{content.title}: {content.technique.part.name}"
    about = {"Title": title, "Creator": "eddyscan", "CreationDate": None}
    with rc_context(settings(PAPER)), PdfPages(data, metadata=about) as pages:
        for sheet in sheets_of(content):
            pages.savefig(sheet)
    return data.getvalue()


def sheets_of(content: ReportContent) -> list[Figure]:
    """Return the A4 sheets of the report as matplotlib figures."""
    from matplotlib import rc_context

    simulated = "  ·  simulation" if content.simulated else ""
    paper = Paper(f"eddyscan {content.software_version}  ·  {content.technique.part.name}{simulated}")
    with rc_context(settings(PAPER)):
        _front(paper, content)
        for number, chapter in enumerate(sections(content), start=1):
            below = _ROOM_PT.get(type(chapter.blocks[0]), 50.0) if chapter.blocks else 0.0
            _heading(paper, f"{number}   {chapter.title}", chapter.lead, below)
            for block in chapter.blocks:
                _block(paper, block)
        paper.number_sheets()
    return paper.sheets


def _front(paper: Paper, content: ReportContent) -> None:
    technique, head = content.technique, headline(content)
    paper.put(content.title, 0, 10, colour=PAPER.muted)
    paper.skip(16)
    paper.put(technique.part.name, 0, 26, bold=True)
    paper.skip(36)
    who = technique.procedure
    line = (
        f"Serial {technique.part.serial} · {technique.part.material} · procedure {who.number} rev. {who.revision} · "
        f"{who.standard} · {content.date or 'date: ____________'}"
    )
    _paragraph(paper, line, colour=PAPER.muted)
    _paragraph(paper, head.verdict, size_pt=12, bold=True, colour=COLOURS[head.kind])
    paper.skip(4)
    width = ROOM_PT / len(head.tiles)
    for k, tile in enumerate(head.tiles):
        paper.put(tile.name, k * width, SMALL_PT, colour=PAPER.muted)
        paper.put(tile.value, k * width, 16, bold=True, drop_pt=11)
        for row, text in enumerate(wrapped(tile.context, width - 8, 6.5)):
            paper.put(text, k * width, 6.5, colour=PAPER.muted, drop_pt=32 + 8 * row)
    paper.skip(60)


def _heading(paper: Paper, title: str, lead: str, below_pt: float) -> None:
    """Write a chapter's title where it and the beginning of what follows fit on one sheet."""
    paper.skip(14)
    paper.need(60 + below_pt)
    paper.rule(colour=PAPER.ink, weight=1.2)
    paper.skip(7)
    paper.put(title, 0, 13, bold=True)
    paper.skip(22)
    if lead:
        _paragraph(paper, lead, colour=PAPER.muted)


def _paragraph(
    paper: Paper,
    text: str,
    *,
    size_pt: float = TEXT_PT,
    bold: bool = False,
    colour: str = PAPER.ink,
    indent_pt: float = 0,
) -> None:
    for line in wrapped(text, ROOM_PT - indent_pt, size_pt, bold=bold):
        paper.need(1.4 * size_pt)
        paper.put(line, indent_pt, size_pt, colour=colour, bold=bold)
        paper.skip(1.4 * size_pt)
    paper.skip(5)


def _block(paper: Paper, block: Block) -> None:
    writers: dict[type, Callable[[Paper, Any], None]] = {
        Facts: _facts,
        Table: _table,
        Chart: _chart,
        Gallery: _gallery,
        Note: _note,
        Scene: _scene,
        Signatures: _signatures,
    }
    writers[type(block)](paper, block)


def _title(paper: Paper, title: str) -> None:
    if title:
        paper.need(44)
        paper.skip(3)
        paper.put(title, 0, TEXT_PT, bold=True)
        paper.skip(15)


def _note(paper: Paper, note: Note) -> None:
    _paragraph(paper, note.text, colour=COLOURS[note.kind], indent_pt=8)


def _facts(paper: Paper, facts: Facts) -> None:
    """Write names and values in two columns, left half first."""
    _title(paper, facts.title)
    half = (len(facts.rows) + 1) // 2
    width = (ROOM_PT - 20) / 2
    for k in range(half):
        pair = [facts.rows[k], *facts.rows[k + half : k + half + 1]]
        cells = [(wrapped(n, 0.52 * width - 6, 8), wrapped(v, 0.48 * width, 8)) for n, v in pair]
        height = 11.0 * max(max(len(names), len(values)) for names, values in cells) + 3
        paper.need(height)
        for column, (names, values) in enumerate(cells):
            left = column * (width + 20)
            for row, text in enumerate(names):
                paper.put(text, left, 8, colour=PAPER.muted, drop_pt=11.0 * row)
            for row, text in enumerate(values):
                paper.put(text, left + 0.52 * width, 8, drop_pt=11.0 * row)
        paper.skip(height)
    paper.skip(8)


def _table(paper: Paper, table: Table) -> None:
    _title(paper, table.title)
    size = SMALL_PT if len(table.columns) < 10 else 6.3
    widths = column_widths(table.columns, table.rows, ROOM_PT, size)
    _table_row(paper, table, table.columns, widths=widths, size=size, head=True)
    for row in table.rows:
        if paper.need(2.4 * size):
            _table_row(paper, table, table.columns, widths=widths, size=size, head=True)
        _table_row(paper, table, row, widths=widths, size=size)
    paper.skip(10)


def _table_row(
    paper: Paper, table: Table, cells: tuple[str, ...], *, widths: list[float], size: float, head: bool = False
) -> None:
    lines = [wrapped(cell, width - 6, size) for cell, width in zip(cells, widths, strict=True)]
    height = 1.35 * size * max(len(cell) for cell in lines) + 4
    paper.need(height)
    left = 0.0
    for k, (cell, width) in enumerate(zip(lines, widths, strict=True)):
        text_column = k in table.text_columns
        place, align = (left, "left") if text_column else (left + width - 6, "right")
        for row, text in enumerate(cell):
            colour = PAPER.muted if head else PAPER.ink
            paper.put(text, place, size, colour=colour, align=align, drop_pt=1.35 * size * row)
        left += width
    paper.skip(height - 2)
    paper.rule(colour=PAPER.ink if head else PAPER.rule, weight=0.8 if head else 0.4)
    paper.skip(3)


def pixels_of(draw: Callable[[Theme], Figure]) -> Pixels:
    """Return a drawing as an (H, W, 3) uint8 picture on white."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = drawn(draw, PAPER)
    figure.set_facecolor("white")
    figure.set_dpi(DOTS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _chart(paper: Paper, chart: Chart) -> None:
    pixels = pixels_of(chart.draw)
    width = ROOM_PT * (0.58 if chart.half else 1.0)
    captions = wrapped(chart.caption, ROOM_PT, SMALL_PT)
    paper.need(width * pixels.shape[0] / pixels.shape[1] + 11 * len(captions) + 6)
    paper.skip(paper.picture(pixels, 0, width) + 3)
    for line in captions:
        paper.put(line, 0, SMALL_PT, colour=PAPER.muted)
        paper.skip(10.5)
    paper.skip(8)


def _scene(paper: Paper, scene: Scene) -> None:
    _chart(paper, scene.still)


def _gallery(paper: Paper, gallery: Gallery) -> None:
    from matplotlib.image import imread

    across, gap = 3, 10.0
    width = (ROOM_PT - gap * (across - 1)) / across
    for first in range(0, len(gallery.pictures), across):
        row = gallery.pictures[first : first + across]
        images = [imread(io.BytesIO(picture.png)) for picture in row]
        height = max(width * image.shape[0] / image.shape[1] for image in images)
        paper.need(height + 24)
        for k, (picture, image) in enumerate(zip(row, images, strict=True)):
            paper.picture(image, k * (width + gap), width)
            for line, text in enumerate(wrapped(picture.caption, width, 6.5)[:2]):
                paper.put(text, k * (width + gap), 6.5, drop_pt=height + 3 + 8 * line)
        paper.skip(height + 24)
    if gallery.caption:
        _paragraph(paper, gallery.caption, size_pt=SMALL_PT, colour=PAPER.muted)


def _signatures(paper: Paper, signatures: Signatures) -> None:
    paper.need(90)
    paper.skip(48)
    width = (ROOM_PT - 40) / max(len(signatures.people), 1)
    for k, (role, name) in enumerate(signatures.people):
        left = k * (width + 40)
        paper.rule(x_pt=left, length_pt=width, colour=PAPER.ink)
        paper.put(f"{role} · {name}", left, 8, drop_pt=4)
        paper.put("Date and signature", left, 7, colour=PAPER.muted, drop_pt=16)
    paper.skip(34)
