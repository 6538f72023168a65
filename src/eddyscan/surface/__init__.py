"""Depth views to one measured surface of the part."""

from eddyscan.surface.compare import Comparison, Deviation, compare
from eddyscan.surface.deproject import deproject
from eddyscan.surface.reconstruct import Reconstruction, reconstruct

__all__ = ["Comparison", "Deviation", "Reconstruction", "compare", "deproject", "reconstruct"]
