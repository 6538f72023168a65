"""The scan plan: a frozen value that prints, saves and iterates."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, BoolArray, IntArray

SCAN, LINK, APPROACH = 0, 1, 2
KINDS = ("scan", "link", "approach")


@dataclass(frozen=True)
class Uncovered:
    """A spot or zone the plan leaves out, and why."""

    reason: str
    area_mm2: float
    centre_mm: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Coverage:
    """What an independent dense check of the plan found.

    Attributes
    ----------
    swept : float
        Share (0-1) of the region inside the margin that the footprint sweeps.
    largest_gap_mm : float
        Largest distance from any spot of that region to the path.
    spacing_mm : (3,) least, mean, largest point distance along rows
    row_distance_mm : (3,) least, mean, largest distance between rows
    footprint_mm : float
        Swept width used for the check.
    uncovered : tuple of Uncovered
    """

    swept: float
    largest_gap_mm: float
    spacing_mm: tuple[float, float, float]
    row_distance_mm: tuple[float, float, float]
    footprint_mm: float
    uncovered: tuple[Uncovered, ...] = ()


@dataclass(frozen=True)
class ScanPlan:
    """Every pose in visiting order: approaches, rows and links.

    Attributes
    ----------
    kind : (N,) int64, one of SCAN, LINK, APPROACH
    row : (N,) int64
        Row number from 0; a link or approach carries the row it leads to.
    point : (N,) int64
        Number within the row from 0 for scan points; -1 for the others.
    s_mm : (N,) [mm]
        Arc length along the row, 0 at its first point.
    surface_mm : (N, 3) [mm, part]
        The spot on the surface below the coil. For links and approaches:
        the coil face itself, moved down by `lift_off_mm` along `normal`.
    normal : (N, 3) unit outward surface normals
    T_part_probe : (N, 4, 4)
        Origin: centre of the coil face; z axis: into the part.
    tilt_deg : (N,) angle between the probe's axis and the surface normal
    lift_off_mm : (N,) predicted distance of the coil face's centre to the surface
    speed_mm_s : (N,) speed of the coil on the way TO this pose
    time_s : (N,) planned time of arrival, 0 at the first pose
    coverage : Coverage
    settings : dict
        The technique's [plan], [probe] and [scan] tables as used.
    inputs : dict
        Name -> SHA-256 of what the plan was made from.
    notes : tuple of str
        Repairs and warnings in words.
    """

    kind: IntArray
    row: IntArray
    point: IntArray
    s_mm: Array
    surface_mm: Array
    normal: Array
    T_part_probe: Array
    tilt_deg: Array
    lift_off_mm: Array
    speed_mm_s: Array
    time_s: Array
    coverage: Coverage
    settings: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.kind)
        if n == 0:
            raise GeometryError("the plan holds no pose. Lower the margin or the pitch.")
        shapes = {
            "row": (n,),
            "point": (n,),
            "s_mm": (n,),
            "surface_mm": (n, 3),
            "normal": (n, 3),
            "T_part_probe": (n, 4, 4),
            "tilt_deg": (n,),
            "lift_off_mm": (n,),
            "speed_mm_s": (n,),
            "time_s": (n,),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise GeometryError(f"plan array {name} has shape {getattr(self, name).shape}, needed is {shape}.")

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def is_scan(self) -> BoolArray:
        """Return the (N,) mask of poses where a reading is taken."""
        return np.asarray(self.kind == SCAN)

    @property
    def n_scan(self) -> int:
        """Return the number of readings the plan asks for."""
        return int(self.is_scan.sum())

    @property
    def n_rows(self) -> int:
        """Return the number of rows."""
        return len(np.unique(self.row[self.is_scan]))

    @property
    def duration_s(self) -> float:
        """Return the planned duration [s]."""
        return float(self.time_s[-1])
