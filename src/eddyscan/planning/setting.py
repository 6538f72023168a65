"""What a machine makes of a part: how it stands over spots, what it reaches, how it links rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh, face_vectors
from eddyscan.core.plan import Uncovered
from eddyscan.core.technique import Technique
from eddyscan.planning.access import Access, AxialAccess, VerticalAccess
from eddyscan.planning.condition import CRUMB_OF_PART
from eddyscan.planning.heights import HeightMap, height_map
from eddyscan.planning.patches import Patch, patches_of
from eddyscan.planning.probe_pose import Stance, normal_stance, vertical_stance
from eddyscan.planning.region import border_distance, faces_seen_from_above, steepest_tilt_deg, travel_guard
from eddyscan.planning.region_guard import Guard, drawn_guard, hidden_guard, tilt_guard
from eddyscan.planning.route import AroundLinks, LevelLinks
from eddyscan.planning.smooth import SmoothSurface
from eddyscan.planning.topology import edges_of

# Faces a little steeper than the limit stay, so that rows end at the slope itself, not at a ragged edge of faces.
STEEP_BAND_DEG = 4.5
FLAT_BOTTOM_MM = 0.5


@dataclass(frozen=True)
class Setting:
    """The part before a machine.

    Attributes
    ----------
    mesh : SurfaceMesh, fit to plan on
    technique : Technique
    travel_mm : (3,) spans of the axes, or None
    heights : HeightMap for a vertical probe, else None
    closed : bool, whether the mesh has no border
    """

    mesh: SurfaceMesh
    technique: Technique
    travel_mm: tuple[float, float, float] | None
    heights: HeightMap | None
    closed: bool

    @property
    def tilt_limit_deg(self) -> float:
        """Return the steepest slope [deg] a vertical tip reads."""
        by_lift_off = steepest_tilt_deg(self.technique.probe, self.technique.analysis.lift_off_max_mm)
        return min(by_lift_off, self.technique.plan.tilt_max_deg)

    def access(self) -> Access:
        """Return which spots the probe can read."""
        if self.heights is not None:
            return VerticalAccess(self.heights, self.technique)
        table = float(self.mesh.vertices[:, 2].min()) if self.closed else None
        return AxialAccess(self.mesh, self.technique, table)

    def stance(self, points: Array, normals: Array) -> Stance:
        """Return the probe's poses over spots (N, 3)."""
        lift = self.technique.scan.lift_off_mm
        if self.heights is None:
            return normal_stance(points, normals, lift)
        return vertical_stance(points, normals, self.heights, self.technique.probe, lift)

    def links(self) -> LevelLinks | AroundLinks:
        """Return how rows are linked."""
        clearance = self.technique.scan.clearance_mm
        if self.heights is None:
            return AroundLinks(self.mesh.vertices, clearance_mm=clearance)
        body = max(self.technique.probe.body_radius_mm, self.technique.probe.tip_radius_mm)
        return LevelLinks(self.heights, clearance_mm=clearance, body_radius_mm=body)

    def patches(self) -> tuple[list[Patch], list[Uncovered]]:
        """Return the patches this machine can look at, and what it cannot.

        Raises
        ------
        GeometryError
            When no patch is left.
        """
        area = 0.5 * np.linalg.norm(face_vectors(self.mesh.vertices, self.mesh.faces), axis=1)
        seen, reason = np.ones(len(area), dtype=bool), "stands on the table"
        if self.heights is not None:
            limit = self.tilt_limit_deg
            seen = faces_seen_from_above(self.mesh.vertices, self.mesh.faces, limit + STEEP_BAND_DEG)
            reason = _steep(limit)
        elif self.closed:
            # A closed part in the part frame stands on the table with its flat bottom.
            down = face_vectors(self.mesh.vertices, self.mesh.faces)[:, 2] < -1.9 * area
            top = self.mesh.vertices[self.mesh.faces, 2].max(axis=1)
            seen = ~(down & (top < self.mesh.vertices[:, 2].min() + FLAT_BOTTOM_MM))
        zones = [Uncovered(reason, float(area[~seen].sum()))] if (~seen).any() else []
        least = CRUMB_OF_PART * float(area.sum())
        patches = patches_of(self.mesh.vertices, self.mesh.faces, seen, least_mm2=least)
        if not patches:
            raise GeometryError(
                f"no piece of the surface can be scanned: of {area.sum():.0f} mm^2, {area[seen].sum():.0f} mm^2 face "
                f"the probe, none of it a connected piece over {least:.1f} mm^2. Check the mesh or use another machine."
            )
        return patches, zones

    def guards(self, patch: Patch, surface: SmoothSurface) -> list[Guard]:
        """Return the reasons to leave zones of a patch out."""
        margin = self.technique.plan.margin_mm
        guards = []
        if margin > 0:
            guards.append(Guard(f"edge zone of {margin:g} mm", border_distance(patch) - margin))
        if self.technique.plan.regions_mm:
            guards.append(Guard("outside the drawn regions", drawn_guard(surface, self.technique.plan.regions_mm)))
        if self.heights is not None:
            guards.append(Guard(_steep(self.tilt_limit_deg), tilt_guard(surface, self.tilt_limit_deg)))
            guards.append(Guard("hidden from above", hidden_guard(surface, self.heights)))
        departure = np.linalg.norm(surface.vertices - patch.vertices, axis=1)
        bridged = 0.5 * self.technique.analysis.lift_off_max_mm + 4 * surface.noise_mm
        if (departure > bridged).any():
            guards.append(Guard("too tight a radius: the footprint bridges it", bridged - departure))
        if self.travel_mm is not None:
            headroom = self.technique.scan.clearance_mm + self.technique.scan.lift_off_mm
            box = np.stack([self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)])
            reach = travel_guard(np.concatenate([surface.vertices, box]), self.travel_mm, headroom)[:-2]
            guards.append(Guard("out of reach of the axes", reach))
        return guards


def setting_of(mesh: SurfaceMesh, technique: Technique, travel_mm: tuple[float, float, float] | None) -> Setting:
    """Return the part before the technique's machine."""
    heights = None
    if technique.plan.machine == "xyz":
        heights = height_map(mesh.vertices, mesh.faces, min(0.5, technique.probe.tip_radius_mm / 4))
    return Setting(mesh, technique, travel_mm, heights, bool((edges_of(mesh.faces).count > 1).all()))


def _steep(tilt_deg: float) -> str:
    return f"steeper than {tilt_deg:.0f} deg for a vertical probe"
