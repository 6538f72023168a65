"""The inspection folder: names, hashes, atomic writes, read back.

    inspections/2026-11-22-block-a/
      inspection.toml  technique.toml  rig.toml
      1-views/  2-surface/  3-plan/  4-record/  5-cscan/  6-report/
      summary.json  log.jsonl

A step reads earlier folders and writes only its own, as a whole: it fills a
temporary folder that replaces the old one in a single rename. `step.json`
inside names the hashes of the inputs, so a stale step is seen. Raw data
(1-views, 4-record) are never changed: a stale record is set aside.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from eddyscan import __version__
from eddyscan.core.errors import FileError, TechniqueError
from eddyscan.core.technique import Technique

STEPS = ("views", "surface", "plan", "record", "cscan", "report")
Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class StepState:
    """What the folder says about one step: "missing", "partial", "stale" or "done"."""

    name: str
    state: str
    why: str = ""
    seconds: float | None = None


class Inspection:
    """One inspection folder on disk."""

    def __init__(self, folder: Path | str) -> None:
        self.folder = Path(folder)

    @classmethod
    def open(cls, folder: Path | str) -> Inspection:
        """Open an existing folder, or raise FileError."""
        inspection = cls(folder)
        if not inspection.folder.is_dir():
            raise FileError(f"there is no inspection folder {folder}. Make one with: eddyscan new {folder}")
        if not inspection.technique_file.is_file():
            raise FileError(
                f"{folder} holds no technique.toml, so it is no inspection folder. Make one with: eddyscan new {folder}"
            )
        return inspection

    @property
    def technique_file(self) -> Path:
        """Return the path of technique.toml."""
        return self.folder / "technique.toml"

    @property
    def rig_file(self) -> Path:
        """Return the path of rig.toml."""
        return self.folder / "rig.toml"

    def step_folder(self, step: str) -> Path:
        """Return the folder of a step, for example 2-surface."""
        return self.folder / f"{STEPS.index(step) + 1}-{step}"

    def file(self, step: str, name: str) -> Path:
        """Return the path of a file of a step."""
        return self.step_folder(step) / name

    def technique(self) -> Technique:
        """Read and check technique.toml."""
        return read_toml(self.technique_file, Technique)

    def view_files(self) -> list[Path]:
        """Return the view files in 1-views in the order of their names."""
        folder = self.step_folder("views")
        suffixes = {".png", ".ply", ".pcd", ".xyz", ".e57"}
        if not folder.is_dir():
            return []
        return sorted(p for p in folder.iterdir() if p.suffix.lower() in suffixes and "-infrared" not in p.name)

    @contextlib.contextmanager
    def writing(self, step: str, inputs: Mapping[str, str], started: datetime | None = None) -> Iterator[Path]:
        """Yield a temporary folder that becomes the step's folder when the block ends well.

        `started` is when the step's work began; without it, now.
        """
        target = self.step_folder(step)
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=self.folder))
        temporary.chmod(0o755)
        started = started or datetime.now(UTC)
        try:
            yield temporary
            write_step_note(temporary, inputs, started)
            replace_folder(temporary, target)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        self.log("step", step=step, seconds=round((datetime.now(UTC) - started).total_seconds(), 3))

    def note(self, step: str) -> dict[str, Any] | None:
        """Return step.json of a step, or None."""
        path = self.file(step, "step.json")
        if not path.is_file():
            return None
        note = read_json(path)
        return note if isinstance(note, dict) else None

    def log(self, event: str, **details: Any) -> None:
        """Append one line to log.jsonl."""
        entry = {"time": datetime.now(UTC).isoformat(timespec="milliseconds"), "event": event, **details}
        with (self.folder / "log.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, default=str) + "\n")

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder against a second program that would write to it."""
        with (self.folder / ".lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise FileError(
                    f"{self.folder} is in use by another eddyscan. Wait for it, or stop it, and try again."
                ) from None
            yield

    def set_aside(self, step: str) -> Path:
        """Rename a step's folder so that its raw data stay, and return the new path."""
        folder = self.step_folder(step)
        number = 1
        while (kept := folder.with_name(f"{folder.name}.kept-{number}")).exists():
            number += 1
        folder.rename(kept)
        self.log("set-aside", step=step, kept=kept.name)
        return kept


def write_step_note(folder: Path, inputs: Mapping[str, str], started: datetime) -> None:
    """Write step.json: hashes of the inputs, times, software version."""
    finished = datetime.now(UTC)
    note = {
        "software": f"eddyscan {__version__}",
        "started": started.isoformat(timespec="milliseconds"),
        "finished": finished.isoformat(timespec="milliseconds"),
        "seconds": round((finished - started).total_seconds(), 3),
        "inputs": dict(inputs),
    }
    write_json(folder / "step.json", note)


def replace_folder(new: Path, target: Path) -> None:
    """Put `new` in the place of `target`: a reader sees the old or the new one."""
    old = target.with_name(f".{target.name}-old-{os.getpid()}")
    if target.exists():
        target.rename(old)
    new.rename(target)
    shutil.rmtree(old, ignore_errors=True)


def read_toml(path: Path, model: type[Model]) -> Model:
    """Read a settings file into its model.

    Raises
    ------
    FileError
        When it is missing or no TOML.
    TechniqueError
        When a key is unknown or a value is out of range; names all of them.
    """
    try:
        with path.open("rb") as file:
            data = tomllib.load(file)
    except FileNotFoundError:
        raise FileError(f"{path} is missing. `eddyscan new` writes a commented one.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path} is no valid TOML: {error}. Mend that line.") from None
    return checked_model(data, model, str(path))


def checked_model(data: Mapping[str, Any], model: type[Model], where: str) -> Model:
    """Return `data` as `model`, or raise TechniqueError that names every bad key and value."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = "; ".join(_fault_in_words(dict(fault)) for fault in error.errors())
        raise TechniqueError(f"{where}: {faults}.") from None


def _fault_in_words(fault: dict[str, Any]) -> str:
    key = ".".join(str(place) for place in fault["loc"]) or "the file"
    if fault["type"] == "extra_forbidden":
        return f"unknown key {key} = {fault['input']!r}; remove it or check its spelling"
    return f"{key} = {fault['input']!r}: {fault['msg']}"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def sha256_of_value(value: BaseModel | Mapping[str, Any]) -> str:
    """Return the SHA-256 of a settings value in canonical JSON."""
    data = value.model_dump(mode="json") if isinstance(value, BaseModel) else dict(value)
    return hashlib.sha256(json.dumps(data, sort_keys=True, default=str).encode()).hexdigest()


def write_json(path: Path, value: Any) -> None:
    """Write JSON atomically: a reader sees the old or the new file."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    with temporary.open("w", encoding="utf-8") as file:
        json.dump(value, file, indent=1, allow_nan=False, default=str)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def read_json(path: Path) -> Any:
    """Read JSON, or raise FileError naming the file and the place."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileError(f"{path} is missing. Run the step that makes it: eddyscan run {path.parent.parent}") from None
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise FileError(f"{path} is no valid JSON ({error}). Delete its folder and run the step again.") from None
