"""The process that reads and edits inspection folders for the page, one question at a time.

Run as ``python -m eddyscan.web.library FD ROOT``. It never touches a device; the
heavy libraries it loads cannot hold up the door or a Stop.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from eddyscan.core.errors import EddyscanError, InputError
from eddyscan.core.parts import PARTS
from eddyscan.web import decisions, figures, scenes, settings, uploads
from eddyscan.web.link import Link
from eddyscan.web.priority import like_everybody
from eddyscan.web.shelf import Shelf

NICENESS = 10
KEPT_SCENES = 12
Question = dict[str, Any]


class Library:
    """Answers the page's questions about one shelf of inspections."""

    def __init__(self, root: Path) -> None:
        self.shelf = Shelf(root)
        self._kept: dict[tuple[Any, ...], bytes] = {}

    def answer(self, question: Question) -> tuple[Any, bytes]:
        """Return the answer as JSON-able value and payload; raises EddyscanError in plain words."""
        name = question.get("ask")
        if not isinstance(name, str) or name not in ANSWERS:
            raise InputError(
                f"the page asked for {str(name)[:40]!r}, which this program does not know. Reload the page."
            )
        answer = ANSWERS[name](self, question)
        return (None, answer) if isinstance(answer, bytes) else (answer, b"")

    def list(self, _: Question) -> Any:
        """Return all inspections and the parts a new one may have."""
        return {"root": str(self.shelf.root), "inspections": self.shelf.entries(), "parts": list(PARTS)}

    def overview(self, question: Question) -> Any:
        """Return the steps and figures of one inspection."""
        return figures.overview(self.shelf.open(question.get("name")))

    def folder(self, question: Question) -> Any:
        """Return where an inspection is."""
        return {"folder": str(self.shelf.open(question.get("name")).folder)}

    def scene(self, question: Question) -> bytes:
        """Return arrays to draw."""
        what = question.get("scene")
        if what not in scenes.SCENES:
            raise InputError(f"there is no scene {str(what)[:40]!r}; known are {', '.join(scenes.SCENES)}.")
        inspection = self.shelf.open(question.get("name"))
        if what == "record":
            return scenes.record(inspection)
        key = (inspection.folder.name, what, *_stamp(inspection.folder))
        return self._remembered(key, lambda: scenes.SCENES[what](inspection))

    def view(self, question: Question) -> bytes:
        """Return the picture of one view."""
        inspection = self.shelf.open(question.get("name"))
        view = question.get("view")
        key = (inspection.folder.name, "view", view, *_stamp(inspection.folder))
        return self._remembered(key, lambda: scenes.view(inspection, view))

    def form(self, question: Question) -> Any:
        """Return the technique as a form."""
        return {"sections": settings.form(self.shelf.open(question.get("name")).technique())}

    def check(self, question: Question) -> Any:
        """Return what is wrong with technique values."""
        return {"faults": settings.faults(self.shelf.open(question.get("name")).technique(), question.get("changes"))}

    def save(self, question: Question) -> Any:
        """Write technique.toml."""
        return settings.save(self.shelf.open(question.get("name")), question.get("changes"), "the page")

    def make(self, question: Question) -> Any:
        """Make an inspection."""
        return {"name": self.shelf.make(question.get("new"), question.get("part"), question.get("seed", 1))}

    def duplicate(self, question: Question) -> Any:
        """Make an inspection with another one's technique."""
        return {"name": self.shelf.duplicate(question.get("name"), question.get("new"))}

    def decide(self, question: Question) -> Any:
        """Keep a decision about an indication."""
        inspection = self.shelf.open(question.get("name"))
        known = {entry["number"]: entry["centre_mm"] for entry in figures.indications(inspection)}
        return decisions.decide(inspection, question.get("decision") or {}, known)

    def take_upload(self, question: Question) -> Any:
        """Check an uploaded file and put it among the views."""
        inspection = self.shelf.open(question.get("name"))
        return uploads.take(inspection, Path(question["temporary"]), question.get("given"))

    def report_file(self, question: Question) -> Any:
        """Return the path of the report."""
        path = self.shelf.open(question.get("name")).file("report", "report.html")
        if not path.is_file():
            raise InputError("there is no report yet. Run the Report step.")
        return {"file": str(path)}

    def _remembered(self, key: tuple[Any, ...], make: Callable[[], bytes]) -> bytes:
        if key not in self._kept:
            while len(self._kept) >= KEPT_SCENES:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = make()
        return self._kept[key]


ANSWERS: dict[str, Callable[[Library, Question], Any]] = {
    name: getattr(Library, name)
    for name in (
        *("list", "overview", "folder", "scene", "view", "form", "check"),
        *("save", "make", "duplicate", "decide", "take_upload", "report_file"),
    )
}


def _stamp(folder: Path) -> tuple[float, ...]:
    """Return what changes whenever a step replaced its folder."""
    places = [folder / "technique.toml", *sorted(p for p in folder.iterdir() if p.is_dir() and p.name[0].isdigit())]
    return tuple(place.stat().st_mtime_ns for place in places if place.exists())


def serve(link: Link, library: Library) -> None:
    """Answer until the door closes the wire."""
    for question in link.messages():
        number = question.pop("id")
        try:
            value, payload = library.answer(question)
            link.send({"id": number, "value": value}, payload)
        except EddyscanError as error:
            link.send({"id": number, "error": str(error), "status": 400 if error.exit_code == 2 else 409})
        except OSError as error:
            words = (
                f"{error.strerror or error}: {error.filename or ''}. Check the folder, its rights and the free space."
            )
            link.send({"id": number, "error": words, "status": 500})
        except Exception as error:
            traceback.print_exc()
            words = f"{question.get('ask')} failed in a way nobody foresaw: {type(error).__name__}: {error}."
            link.send({"id": number, "error": words, "status": 500})


def main() -> None:
    """Run as a helper process."""
    like_everybody()
    os.nice(NICENESS)
    try:
        serve(Link.of_descriptor(int(sys.argv[1])), Library(Path(json.loads(sys.argv[2]))))
    except OSError:
        return


if __name__ == "__main__":
    main()
