"""What people decided about indications: kept with name and time, never overwritten."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from eddyscan.core.errors import InputError
from eddyscan.inspection import Inspection

FILE = "decisions.jsonl"
VERDICTS = ("accept", "reject", "comment")
MAX_COMMENT = 2000
MAX_NAME = 80


def decide(inspection: Inspection, given: Mapping[str, Any], known: Mapping[int, Sequence[float]]) -> dict[str, Any]:
    """Append one decision and return it.

    `known` is number -> centre [mm, part]; the centre is kept with the decision,
    because a new analysis may number its indications otherwise.

    Raises InputError when the verdict, the indication or the name is not usable.
    """
    number, verdict = given.get("number"), given.get("verdict")
    name, comment = str(given.get("name") or "").strip(), str(given.get("comment") or "").strip()
    if not isinstance(number, int) or number not in known:
        raise InputError(f"there is no indication {str(number)[:20]}; known are {sorted(known) or 'none'}.")
    if verdict not in VERDICTS:
        raise InputError(f"{str(verdict)[:40]!r} is no decision; known are {', '.join(VERDICTS)}.")
    if not name:
        raise InputError("a decision needs the name of the person who makes it. Fill in your name.")
    if len(name) > MAX_NAME or len(comment) > MAX_COMMENT:
        raise InputError(f"name or comment is too long: at most {MAX_NAME} and {MAX_COMMENT} characters. Shorten it.")
    if verdict == "comment" and not comment:
        raise InputError("the comment is empty. Write a few words, or press accept or reject.")
    entry = {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "number": number,
        "centre_mm": [round(float(value), 2) for value in known[number]],
        "verdict": verdict,
        "name": name,
        "comment": comment,
    }
    with (inspection.folder / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry, ensure_ascii=False) + "\n")
    return entry


def decisions(inspection: Inspection) -> list[dict[str, Any]]:
    """Return all decisions in the order they were made; a torn last line is left out."""
    path = inspection.folder / FILE
    if not path.is_file():
        return []
    made = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        made.append(entry)
    return made
