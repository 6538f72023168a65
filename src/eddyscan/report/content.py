"""What a report is made from: the nouns of one inspection, each of them optional."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from eddyscan.core.cloud import PointCloud
from eddyscan.core.cscan import CScan
from eddyscan.core.depth import DepthImage
from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.indication import Indication
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.plan import ScanPlan, Uncovered
from eddyscan.core.record import ScanRecord
from eddyscan.core.registration import Registration
from eddyscan.core.technique import Technique


@dataclass(frozen=True)
class NominalComparison:
    """The measured surface against the one it should be.

    Attributes
    ----------
    name : str
        The nominal part's or file's name.
    surface : SurfaceMesh
        The nominal surface [mm, nominal frame].
    T_nominal_mesh : (4, 4)
        Takes the measured mesh to the nominal frame.
    signed_mm : (V,) [mm] or None
        Signed distance of every measured vertex, positive outside; NaN where
        the nominal has no counterpart.
    deviation : dict
        mean_abs_mm, rmse_mm, p95_mm, max_mm, coverage ..., as `compare` gives them.
    """

    name: str
    surface: SurfaceMesh
    T_nominal_mesh: Array
    signed_mm: Array | None = None
    deviation: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ReportContent:
    """Everything a report may show; what is missing is named in it.

    Attributes
    ----------
    technique : the written procedure as used
    title, date : headline and date in words; date None leaves a line to fill in
    simulated : True when the virtual cell took the place of hardware
    views, registrations : what the camera saw and how the views were brought together
    mesh : measured surface [mm, part]
    nominal : comparison with the nominal surface
    plan, record : what was planned and what was read
    cscan, indications : what the analysis made of it
    lift_off_mm : (N,) [mm] lift-off of every reading as told by the probe; NaN unknown
    residual_ohm : (N,) [ohm] what lift-off and conductivity do not explain
    coarse_lift_off_mm : (M,) [mm] lift-off of the coarse pass before the path was corrected; None for one pass
    statistics : names with units -> numbers, from the analysis
    not_examined : spots not covered for reasons found after planning (failed reference check, overload ...)
    deviations : departures from the procedure, in words
    hashes : file name -> SHA-256
    software_version : str
    truth : measured against the hidden world; virtual cell only
    timings_s : step -> seconds
    notes : warnings of the steps, in words
    """

    technique: Technique
    title: str = "Eddy-current inspection"
    date: str | None = None
    simulated: bool = False
    views: Sequence[DepthImage | PointCloud] = ()
    registrations: Sequence[Registration] = ()
    mesh: SurfaceMesh | None = None
    nominal: NominalComparison | None = None
    plan: ScanPlan | None = None
    record: ScanRecord | None = None
    cscan: CScan | None = None
    indications: Sequence[Indication] | None = None
    lift_off_mm: Array | None = None
    residual_ohm: ComplexArray | None = None
    coarse_lift_off_mm: Array | None = None
    statistics: Mapping[str, Any] = field(default_factory=dict)
    not_examined: Sequence[Uncovered] = ()
    deviations: Sequence[str] = ()
    hashes: Mapping[str, str] = field(default_factory=dict)
    software_version: str = "not stated"
    truth: Mapping[str, Any] | None = None
    timings_s: Mapping[str, float] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def __post_init__(self) -> None:
        for name in ("lift_off_mm", "residual_ohm"):
            values = getattr(self, name)
            if values is None:
                continue
            readings = 0 if self.record is None else len(self.record)
            if len(values) != readings:
                raise GeometryError(
                    f"report column {name} has {len(values)} entries, the record has {readings} readings. "
                    "Analyse this very record again."
                )
        if self.truth is not None and not self.simulated:
            raise GeometryError("a report with a truth part is a simulation and must say so: set simulated=True.")
