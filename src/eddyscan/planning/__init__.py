"""From a surface to a plan: rows, points, probe poses, links, times, and the proof of coverage."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eddyscan.planning.planner import plan
    from eddyscan.planning.timing import MotionLimits

__all__ = ["MotionLimits", "plan"]


def __getattr__(name: str) -> object:
    """Load the planner when it is first asked for: it brings scipy along."""
    if name == "plan":
        from eddyscan.planning.planner import plan

        return plan
    if name == "MotionLimits":
        from eddyscan.planning.timing import MotionLimits

        return MotionLimits
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
