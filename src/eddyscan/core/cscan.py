"""Values on the surface: one number per vertex and channel."""

from __future__ import annotations

from dataclasses import dataclass, field

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array, BoolArray
from eddyscan.core.mesh import SurfaceMesh


@dataclass(frozen=True)
class CScan:
    """Channels mapped on the surface.

    Attributes
    ----------
    mesh : SurfaceMesh
    channels : dict of name -> (V,) float64
        For example "amplitude_ohm", "lift_off_mm", "residual_ohm"; units in the name.
    covered : (V,) bool
        Where a reading is near enough to speak for the vertex.
    """

    mesh: SurfaceMesh
    covered: BoolArray
    channels: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = len(self.mesh.vertices)
        for name, values in {"covered": self.covered, **self.channels}.items():
            if values.shape != (n,):
                raise GeometryError(f"C-scan channel {name} has shape {values.shape}, the surface has {n} vertices.")
