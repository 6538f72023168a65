"""One function per arrow, folder in -> folder out; what the commands and the page both call."""

from __future__ import annotations

from eddyscan.pipeline.files import (
    compare_meshes,
    export,
    plan_on_mesh,
    plan_rows,
    plan_technique,
    surface_from_views,
    surface_settings,
)
from eddyscan.pipeline.jogging import jog_session, keep_touched
from eddyscan.pipeline.line import demo, new_inspection, run, single_step, states
from eddyscan.pipeline.signals import signal, signal_table
from eddyscan.pipeline.simulated import simulators

__all__ = [
    "compare_meshes",
    "demo",
    "export",
    "jog_session",
    "keep_touched",
    "new_inspection",
    "plan_on_mesh",
    "plan_rows",
    "plan_technique",
    "run",
    "signal",
    "signal_table",
    "simulators",
    "single_step",
    "states",
    "surface_from_views",
    "surface_settings",
]
