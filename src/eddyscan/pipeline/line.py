"""The whole line on a folder: every step that is missing or stale, in order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eddyscan.core.commented_toml import commented_toml
from eddyscan.core.errors import FileError, InputError
from eddyscan.core.parts import PARTS, named_part
from eddyscan.core.progress import Progress, silent
from eddyscan.core.technique import Part, Plan, Technique
from eddyscan.inspection import STEPS, Inspection, StepState
from eddyscan.pipeline import rigs, steps
from eddyscan.pipeline.control import ScanControl
from eddyscan.pipeline.scan import scan_plan
from eddyscan.pipeline.states import states_of
from eddyscan.pipeline.summary import write_summary
from eddyscan.pipeline.write_report import write_report

STEEP_DEG = 50.0  # a vertical coil on a steeper slope is a millimetre off and reads little
TECHNIQUE_HEADING = """The written procedure of this inspection. Lengths in mm, angles in deg.
A key you do not need can go: its default holds. An unknown key is an error."""


def new_inspection(folder: Path, *, part: str = "block-a", seed: int = 1) -> Inspection:
    """Make an inspection folder with a commented technique.toml and rig.toml.

    Raises FileError when the folder already holds one, InputError for an unknown part.
    """
    named_part(part)
    inspection = Inspection(folder)
    if inspection.technique_file.exists():
        raise FileError(
            f"{folder} already holds an inspection. Name another folder, or go on with: eddyscan run {folder}"
        )
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; name a folder.")
    inspection.step_folder("views").mkdir(parents=True, exist_ok=True)
    technique = Technique(part=Part(name=part, nominal=part), plan=Plan(tilt_max_deg=STEEP_DEG))
    inspection.technique_file.write_text(commented_toml(technique, TECHNIQUE_HEADING), encoding="utf-8")
    inspection.rig_file.write_text(rigs.virtual_rig_text(part, seed), encoding="utf-8")
    inspection.log("new", part=part, seed=seed)
    return inspection


def demo(folder: Path, *, part: str = "block-a", seed: int = 1, progress: Progress = silent) -> dict[str, Any]:
    """Inspect a part in the virtual cell from views to report; an existing demo folder goes on."""
    if part not in PARTS:
        raise InputError(f"there is no part called {part!r}; known are {', '.join(PARTS)}.")
    existing = Inspection(folder)
    if not existing.technique_file.exists():
        new_inspection(folder, part=part, seed=seed)
    else:
        rigs.require_same_cell(existing, part, seed)
    return run(folder, progress=progress)


def states(folder: Path) -> list[StepState]:
    """Return the state of every step of a folder."""
    return states_of(Inspection.open(folder))


@dataclass(frozen=True)
class _Wishes:
    """How the steps of one call are to be done."""

    dry_run: bool = False
    pdf: bool = False
    progress: Progress = silent
    control: ScanControl | None = None


def run(
    folder: Path,
    *,
    rig_file: Path | None = None,
    arm: bool = False,
    dry_run: bool = False,
    progress: Progress = silent,
    control: ScanControl | None = None,
) -> dict[str, Any]:
    """Do every missing or stale step and return the summary."""
    wishes = _Wishes(dry_run=dry_run, progress=progress, control=control)
    with _rig_of(folder, rig_file, arm) as (inspection, rig):
        for step in STEPS:
            if _state(inspection, step) != "done":
                _do(step, inspection, rig, wishes)
            if dry_run and step == "record":
                break
        return write_summary(inspection, rig)


def single_step(
    folder: Path,
    step: str,
    *,
    rig_file: Path | None = None,
    arm: bool = False,
    dry_run: bool = False,
    pdf: bool = False,
    progress: Progress = silent,
    control: ScanControl | None = None,
) -> dict[str, Any]:
    """Do one step of a folder, whatever its state; the steps before it must be there."""
    wishes = _Wishes(dry_run=dry_run, pdf=pdf, progress=progress, control=control)
    with _rig_of(folder, rig_file, arm) as (inspection, rig):
        _do(step, inspection, rig, wishes)
        return write_summary(inspection, rig)


@contextmanager
def _rig_of(folder: Path, rig_file: Path | None, arm: bool) -> Iterator[tuple[Inspection, rigs.LazyRig]]:
    """Hold the folder for this call and close its rig at the end, if a step opened it."""
    inspection = Inspection.open(folder)
    inspection.technique()
    with inspection.locked(), ExitStack() as stack:
        yield inspection, rigs.LazyRig(inspection, rig_file, arm, stack)


def _state(inspection: Inspection, step: str) -> str:
    return next(state.state for state in states_of(inspection) if state.name == step)


def _require_earlier(inspection: Inspection, step: str) -> None:
    needs = {"plan": ["surface"], "record": ["plan"], "cscan": ["surface", "record"], "report": ["surface"]}
    present = {s.name for s in states_of(inspection) if s.state in ("done", "stale")}
    for other in needs.get(step, []):
        if other not in present:
            raise FileError(
                f"{inspection.step_folder(other)} is missing or not finished, and {step} needs it. "
                f"Run: eddyscan run {inspection.folder}"
            )


def _do(step: str, inspection: Inspection, rig: rigs.LazyRig, wishes: _Wishes) -> None:
    _require_earlier(inspection, step)
    progress = wishes.progress
    match step:
        case "views":
            steps.take_views(inspection, rig.open(), progress)
        case "surface":
            steps.make_surface(inspection, progress)
        case "plan":
            steps.make_plan(inspection, rig.travel_mm(), progress)
        case "record":
            scan_plan(inspection, rig.open(), dry_run=wishes.dry_run, progress=progress, control=wishes.control)
        case "cscan":
            steps.analyse_record(inspection, progress)
        case _:
            write_report(inspection, rig, progress, pdf=wishes.pdf)
