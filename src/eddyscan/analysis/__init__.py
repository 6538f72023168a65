"""Signals: from raw readings to lift-off, C-scan on the surface and indications.

The line calls

    analyse(record, mesh, technique, *, progress) -> AnalysisResult
    corrected_plan(plan, record, result, technique, *, mesh=None) -> ScanPlan
        between a coarse and a fine pass: poses moved to hold the planned lift-off
    surface_correction(record, result, mesh, technique) -> SurfaceCorrection
    corrected_surface(mesh, correction) -> SurfaceMesh
        the part as the probe measured it, with its uncertainty

A record's `meta` may hold `air` ([resistance, reactance] in ohm) and `coil` (its
calibrated sizes), as the alignment's `as_dict()` gives them.
"""

from eddyscan.analysis.correction import corrected_plan, corrected_surface, surface_correction
from eddyscan.analysis.gap_field import SurfaceCorrection
from eddyscan.analysis.inspect import analyse
from eddyscan.analysis.result import AnalysisResult

__all__ = [
    "AnalysisResult",
    "SurfaceCorrection",
    "analyse",
    "corrected_plan",
    "corrected_surface",
    "surface_correction",
]
