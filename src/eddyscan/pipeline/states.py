"""Which steps of a folder are missing or stale, from the hashes of their inputs."""

from __future__ import annotations

from pathlib import Path

from eddyscan import __version__
from eddyscan.inspection import STEPS, Inspection, StepState, sha256_of, sha256_of_value

OUTPUTS = {
    "surface": "surface.ply",
    "plan": "plan.json",
    "record": "record.sqlite",
    "cscan": "cscan.ply",
    "report": "report.html",
}


def inputs_of(inspection: Inspection, step: str) -> dict[str, str]:
    """Return name -> SHA-256 of everything the step reads, as it is now."""
    technique = inspection.technique()
    match step:
        case "views":
            return {"rig.toml": sha256_of(inspection.rig_file)} if inspection.rig_file.is_file() else {}
        case "surface":
            files = [*inspection.view_files(), *_beside_views(inspection)]
            hashes = {f"1-views/{path.name}": sha256_of(path) for path in files}
            return hashes | {"technique.toml [surface]": sha256_of_value(technique.surface)}
        case "plan":
            settings = {name: getattr(technique, name).model_dump(mode="json") for name in ("plan", "probe", "scan")}
            return _output(inspection, "surface") | {"technique.toml [plan, probe, scan]": sha256_of_value(settings)}
        case "record":
            touched = inspection.folder / "alignment.json"
            return _output(inspection, "plan") | ({touched.name: sha256_of(touched)} if touched.is_file() else {})
        case "cscan":
            settings = {
                name: getattr(technique, name).model_dump(mode="json")
                for name in ("analysis", "part", "probe", "drive")
            }
            return (
                _output(inspection, "surface")
                | _output(inspection, "record")
                | {"technique.toml [analysis, part, probe, drive]": sha256_of_value(settings)}
            )
        case _:
            steps = [other for other in OUTPUTS if other not in ("report", step)]
            hashes = {"technique.toml": sha256_of(inspection.technique_file), "software": __version__}
            for other in steps:
                hashes |= _output(inspection, other)
            return hashes


def states_of(inspection: Inspection) -> list[StepState]:
    """Return the state of every step: "missing", "partial", "stale" or "done"."""
    states: list[StepState] = []
    for step in STEPS:
        states.append(_state_of(inspection, step))
    return states


def _state_of(inspection: Inspection, step: str) -> StepState:
    note = inspection.note(step)
    if step == "views":
        files = inspection.view_files()
        return StepState(step, "done" if files else "missing", f"{len(files)} views", (note or {}).get("seconds"))
    if not inspection.file(step, OUTPUTS[step]).is_file():
        return StepState(step, "missing")
    if note is None:
        return StepState(step, "partial", "not finished")
    now = inputs_of(inspection, step)
    changed = [name for name in sorted(now.keys() | note["inputs"].keys()) if now.get(name) != note["inputs"].get(name)]
    if changed:
        return StepState(step, "stale", f"{', '.join(changed)} changed since", note.get("seconds"))
    return StepState(step, "done", "", note.get("seconds"))


def _output(inspection: Inspection, step: str) -> dict[str, str]:
    path = inspection.file(step, OUTPUTS[step])
    return {f"{path.parent.name}/{path.name}": sha256_of(path)} if path.is_file() else {}


def _beside_views(inspection: Inspection) -> list[Path]:
    folder = inspection.step_folder("views")
    return [path for name in ("camera.json", "poses.json") if (path := folder / name).is_file()]
