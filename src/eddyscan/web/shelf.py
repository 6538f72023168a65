"""The inspections on the shelf: list them, open one by its name, make and copy them."""

from __future__ import annotations

import re
import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from eddyscan.core.errors import EddyscanError, FileError, InputError
from eddyscan.core.parts import PARTS
from eddyscan.inspection import Inspection

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}")


class Shelf:
    """One folder of inspection folders; a name is only ever compared with what is there."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def names(self) -> list[str]:
        """Return the inspections' names, newest first."""
        if not self.root.is_dir():
            return []
        found = [p for p in self.root.iterdir() if not p.name.startswith(".") and (p / "technique.toml").is_file()]
        return [p.name for p in sorted(found, key=lambda p: -(p / "technique.toml").stat().st_mtime)]

    def open(self, name: Any) -> Inspection:
        """Open an inspection of this shelf, or raise FileError."""
        if not isinstance(name, str) or name not in self.names():
            raise FileError(f"there is no inspection {str(name)[:80]!r} in {self.root}. Choose one of the list.")
        return Inspection.open(self.root / name)

    def entries(self) -> list[dict[str, Any]]:
        """Return name, part, date and state of every inspection."""
        return [_entry(Inspection(self.root / name)) for name in self.names()]

    def make(self, name: Any, part: Any, seed: Any) -> str:
        """Make an inspection and return its name."""
        from eddyscan.pipeline import new_inspection

        if part not in PARTS:
            raise InputError(f"there is no part called {str(part)[:80]!r}; known are {', '.join(PARTS)}.")
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
            raise InputError(f"seed {str(seed)[:40]!r} is no whole number from 0 to {2**31 - 1}.")
        new_inspection(self._free(name), part=part, seed=seed)
        return str(name)

    def duplicate(self, source: Any, name: Any) -> str:
        """Make an inspection with another's technique.toml and rig.toml, and return its name."""
        model = self.open(source)
        folder = self._free(name)
        (folder / "1-views").mkdir(parents=True)
        for file in (model.technique_file, model.rig_file):
            if file.is_file():
                shutil.copyfile(file, folder / file.name)
        Inspection(folder).log("new", technique_of=model.folder.name)
        return str(name)

    def _free(self, name: Any) -> Path:
        if not isinstance(name, str) or not NAME.fullmatch(name) or name.endswith((".", " ")):
            raise InputError(
                f"{str(name)[:80]!r} is no good name: use up to 64 letters, digits, blanks, dots, - and _, "
                "with a letter or digit first."
            )
        folder = self.root / name
        if folder.exists():
            raise FileError(f"there is an inspection {name!r} already. Choose another name, or open that one.")
        return folder


def _entry(inspection: Inspection) -> dict[str, Any]:
    fault, part, serial = "", "?", ""
    try:
        technique = inspection.technique()
        part, serial = technique.part.name, technique.part.serial
    except EddyscanError as error:
        fault = str(error)
    changed = max(path.stat().st_mtime for path in inspection.folder.iterdir())
    return {
        "name": inspection.folder.name,
        "part": part,
        "serial": "" if serial == "not stated" else serial,
        "date": datetime.fromtimestamp(changed, UTC).isoformat(timespec="seconds"),
        "state": "damaged" if fault else reached(inspection),
        "fault": fault,
    }


def reached(inspection: Inspection) -> str:
    """Return how far an inspection got, from which files are there."""
    if inspection.file("report", "report.html").is_file():
        return "reported"
    if inspection.file("cscan", "indications.json").is_file():
        return "analysed"
    if inspection.file("record", "record.sqlite").is_file():
        return "scanned" if inspection.note("record") is not None else "interrupted"
    if inspection.file("plan", "plan.json").is_file():
        return "planned"
    if inspection.file("surface", "surface.ply").is_file():
        return "surface made"
    return "views taken" if inspection.view_files() else "new"
