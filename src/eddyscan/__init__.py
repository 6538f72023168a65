"""eddyscan: automated eddy-current inspection of curved parts.

Depth-camera views become a surface, the surface a scan plan, the plan a
record of impedances, the record a C-scan with indications and a report.
"""

__version__ = "0.1.0"
