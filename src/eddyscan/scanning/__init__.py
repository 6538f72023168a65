"""Run a plan on a stage: check everything first, then move, read and keep every reading.

This room alone holds a plan and a device at the same time; it sees the
protocols, never a driver or a simulator.
"""

from eddyscan.scanning.alignment import TouchAlignment, align_from_corner, align_from_points
from eddyscan.scanning.checking import check
from eddyscan.scanning.dry_run import what_would_move
from eddyscan.scanning.experiment import StageExperiment, stage_experiment
from eddyscan.scanning.jog import JogSession, JogState
from eddyscan.scanning.keep_out import KeepOut
from eddyscan.scanning.running import run
from eddyscan.scanning.tilt import TiltHead

__all__ = [
    "JogSession",
    "JogState",
    "KeepOut",
    "StageExperiment",
    "TiltHead",
    "TouchAlignment",
    "align_from_corner",
    "align_from_points",
    "check",
    "run",
    "stage_experiment",
    "what_would_move",
]
