"""The report's chapters in order, each made from what the content holds."""

from __future__ import annotations

from eddyscan.report.blocks import Section
from eddyscan.report.content import ReportContent
from eddyscan.report.sections_part import equipment, procedure, result
from eddyscan.report.sections_result import coverage, indications, references, signals
from eddyscan.report.sections_scan import alignment, plan, positions
from eddyscan.report.sections_surface import nominal, surface, views
from eddyscan.report.sections_trace import provenance, signatures, truth

CHAPTERS = (
    result,
    procedure,
    equipment,
    views,
    surface,
    nominal,
    plan,
    alignment,
    positions,
    references,
    signals,
    coverage,
    indications,
    truth,
    provenance,
    signatures,
)


def sections(content: ReportContent) -> tuple[Section, ...]:
    """Return every chapter; one that has nothing to say in any inspection of this kind is left out."""
    return tuple(chapter for make in CHAPTERS if (chapter := make(content)) is not None)
