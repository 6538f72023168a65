"""Signals: from raw readings to lift-off, C-scan on the surface and indications.

The line calls

    analyse(record, mesh, technique, *, progress) -> AnalysisResult
"""

from eddyscan.analysis.inspect import analyse
from eddyscan.analysis.result import AnalysisResult

__all__ = ["AnalysisResult", "analyse"]
