"""Slots in the part: where they are on the curved surface, and what they add to the coil's impedance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array
from eddyscan.core.parts import Hemisphere, NominalPart
from eddyscan.devices.sim.world_foot import FootFinder
from eddyscan.devices.sim.world_settings import WorldFlaw, WorldSettings
from eddyscan.physics import Slot

DEFAULT_SIZES_MM = ((3.0, 1.0), (2.0, 0.5), (1.0, 0.3), (0.75, 0.25))
"""Length and depth of the flaws that every default part has."""

OPENING_MM = 0.1
MARGIN_MM = 14.0
APART_MM = 22.0
DOME_CAP_DEG = 35.0
ABOVE_MM = 300.0


@dataclass(frozen=True)
class Flaw:
    """A slot on the exact surface.

    Attributes
    ----------
    centre_mm : (3,) [mm, part]
    along, across, normal : (3,) unit vectors [part]
        Long axis, width direction, outward surface normal.
    size : WorldFlaw
    """

    centre_mm: Array
    along: Array
    across: Array
    normal: Array
    size: WorldFlaw

    def local_mm(self, point_mm: Array) -> tuple[float, float]:
        """Return where a surface spot (3,) [mm, part] lies along and across the slot, unrolled [mm].

        The spot's distance to the slot's centre is kept and its direction taken
        in the tangent plane: exact on a sphere up to chord against arc.
        """
        offset = point_mm - self.centre_mm
        x, y = float(offset @ self.along), float(offset @ self.across)
        flat = np.hypot(x, y)
        stretch = float(np.linalg.norm(offset)) / flat if flat > 1e-9 else 1.0
        return x * stretch, y * stretch

    def as_dict(self) -> dict[str, object]:
        """Return the flaw for summary.json [mm, deg, part]."""
        return {
            "centre_mm": [round(float(c), 3) for c in self.centre_mm],
            "angle_deg": self.size.angle_deg,
            "length_mm": self.size.length_mm,
            "depth_mm": self.size.depth_mm,
            "opening_mm": self.size.opening_mm,
            "profile": self.size.profile,
        }


def placed(part: NominalPart, size: WorldFlaw, finder: FootFinder | None = None) -> Flaw:
    """Put a slot on the surface straight below its (x, y), its long axis at its angle to the part's x.

    Raises
    ------
    TechniqueError
        When (x, y) is not above the inspected surface, or the sizes are no slot's.
    """
    Slot(size.length_mm, size.depth_mm, size.opening_mm, size.profile)
    finder = finder or FootFinder(part)
    at = np.array([size.x_mm, size.y_mm, ABOVE_MM])
    for _ in range(30):
        foot = finder.at(at)
        slip = at[:2] - foot.point_mm[:2]
        if np.hypot(*(foot.point_mm[:2] - (size.x_mm, size.y_mm))) < 1e-6:
            break
        at = np.array([size.x_mm, size.y_mm, foot.point_mm[2] - float(foot.normal[:2] @ slip) / foot.normal[2]])
    if np.hypot(*(foot.point_mm[:2] - (size.x_mm, size.y_mm))) > 0.01 or foot.edge_mm < 0:
        raise TechniqueError(
            f"a flaw at x = {size.x_mm:g}, y = {size.y_mm:g} mm lies off the surface of {part.name}; "
            "give a place inside the part's outline."
        )
    n = foot.normal
    angle = np.radians(size.angle_deg)
    ex = np.array([1.0, 0.0, 0.0]) - n[0] * n
    ex /= np.linalg.norm(ex)
    ey = np.cross(n, ex)
    along = np.cos(angle) * ex + np.sin(angle) * ey
    return Flaw(foot.point_mm, along, np.cross(n, along), n, size)


def default_flaws(part: NominalPart, seed: int) -> list[WorldFlaw]:
    """Draw the places and angles of the default flaws from `seed`, away from edges and each other."""
    rng = np.random.default_rng([seed, 7])
    low, high = _outline(part)
    chosen: list[WorldFlaw] = []
    for length, depth in DEFAULT_SIZES_MM:
        for _ in range(500):
            x, y = rng.uniform(low, high)
            if all(np.hypot(x - f.x_mm, y - f.y_mm) > APART_MM for f in chosen) and _on_cap(part, x, y):
                angle = float(rng.uniform(0.0, 180.0))
                flaw = WorldFlaw(
                    x_mm=round(float(x), 3), y_mm=round(float(y), 3), angle_deg=round(angle, 1),
                    length_mm=length, depth_mm=depth, opening_mm=OPENING_MM,
                )  # fmt: skip
                chosen.append(flaw)
                break
    return chosen


def flaws_of(settings: WorldSettings, part: NominalPart, finder: FootFinder) -> tuple[Flaw, ...]:
    """Return the slots that the settings put into the part."""
    sizes: list[WorldFlaw] = list(settings.slots) if settings.flaws != "none" else []
    if settings.flaws == "default":
        sizes = default_flaws(part, settings.seed) + sizes
    return tuple(placed(part, size, finder) for size in sizes)


def _outline(part: NominalPart) -> tuple[Array, Array]:
    top = part.top_mesh(4.0).vertices[:, :2]
    return top.min(axis=0) + MARGIN_MM, top.max(axis=0) - MARGIN_MM


def _on_cap(part: NominalPart, x: float, y: float) -> bool:
    """Return whether the spot is one that a vertical probe can reach; the dome's flanks are not."""
    if not isinstance(part, Hemisphere):
        return True
    R = part.radius_mm
    return bool(np.hypot(x - R, y - R) < R * np.sin(np.radians(DOME_CAP_DEG)))
