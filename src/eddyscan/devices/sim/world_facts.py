"""What the world's settings decide before any device is started: part, true pose, flaws."""

from __future__ import annotations

from dataclasses import dataclass

from eddyscan.core.frames import Array
from eddyscan.core.parts import NominalPart, named_part
from eddyscan.devices.sim.flaws import Flaw, flaws_of
from eddyscan.devices.sim.world_foot import FootFinder
from eddyscan.devices.sim.world_placement import hidden_pose
from eddyscan.devices.sim.world_settings import WorldSettings


@dataclass(frozen=True)
class CellFacts:
    """What the world's settings decide, before any device is started.

    Attributes
    ----------
    part : NominalPart
    T_stage_part : (4, 4) true pose on the stage
    flaws : tuple of Flaw
    """

    part: NominalPart
    T_stage_part: Array
    flaws: tuple[Flaw, ...]


def facts_of(world: WorldSettings) -> CellFacts:
    """Return the part, its true pose on the stage and its flaws."""
    part = named_part(world.part)
    flaws = flaws_of(world, part, FootFinder(part))
    return CellFacts(part, hidden_pose(part, world.placement, world.seed), flaws)
