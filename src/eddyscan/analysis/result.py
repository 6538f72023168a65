"""What the analysis of one scan gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from eddyscan.core.cscan import CScan
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.indication import Indication


@dataclass(frozen=True)
class AnalysisResult:
    """The signals of a scan on the surface of the part.

    Attributes
    ----------
    cscan : CScan
        Channels "lift_off_mm", "amplitude_ohm", "residual_ohm", "score" and
        "sensitivity"; see `analyse`.
    indications : tuple of Indication
    lift_off_mm : (N,) [mm]
        Per reading of the record; NaN where the reading is flagged or the metal out of reach.
    residual_ohm : (N,) complex [ohm]
        Reading minus the sound part's at that lift-off and tilt, slow changes taken
        out; unrotated; NaN where `lift_off_mm` is.
    statistics : dict
        Plain numbers in mm, ohm and shares: what the report prints.
    foot_mm : (N, 3) [mm, part] spot on the surface below each reading
    score : (N,)
        Residual matched with a crack's footprint over its robust noise; NaN where not called.
    """

    cscan: CScan
    indications: tuple[Indication, ...]
    lift_off_mm: Array
    residual_ohm: ComplexArray
    statistics: dict[str, Any] = field(default_factory=dict)
    foot_mm: Array | None = None
    score: Array | None = None
