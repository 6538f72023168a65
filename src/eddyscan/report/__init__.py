"""The report: one self-contained page, and the same on paper."""

from eddyscan.report.content import NominalComparison, ReportContent
from eddyscan.report.html import render_html
from eddyscan.report.pdf import render_pdf

__all__ = ["NominalComparison", "ReportContent", "render_html", "render_pdf"]
