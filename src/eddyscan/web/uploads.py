"""Files that come in through the page: limited, checked by content, named by us."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

from eddyscan.core.errors import FileError, InputError
from eddyscan.inspection import Inspection

MAX_BYTES = 256 << 20
MAX_VIEWS = 60
MAX_JSON_BYTES = 1 << 20
SPARE_BYTES = 1 << 30
MAGIC = {".png": b"\x89PNG\r\n\x1a\n", ".ply": b"ply", ".e57": b"ASTM-E57"}
SUFFIXES = (".png", ".ply", ".pcd", ".xyz", ".e57")
BESIDE = ("camera.json", "poses.json")
SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,60}")


def refusal(size: int | None, free: int) -> str | None:
    """Return why a file of this announced size cannot come in, or None."""
    if size is None:
        return "the browser did not say how big the file is. Use a current browser."
    if size > MAX_BYTES:
        return (
            f"the file has {size / 1e6:.0f} MB, the limit is {MAX_BYTES / 1e6:.0f} MB. "
            "Copy it into 1-views/ by hand, or thin the cloud."
        )
    if size == 0:
        return "the file is empty. Choose the file again."
    if free - size < SPARE_BYTES:
        return f"only {free / 1e9:.1f} GB are free on the disk. Free some space first."
    return None


def free_bytes(folder: Path) -> int:
    """Return the free space where a folder is."""
    return shutil.disk_usage(folder).free


def safe_name(given: Any, taken: set[str]) -> str:
    """Return the name an uploaded file gets: what is harmless of the given one, never one that is taken.

    Raises InputError for a kind of file that is no view.
    """
    last = str(given).replace("\\", "/").rsplit("/", 1)[-1]
    if last in BESIDE:
        return last
    suffix = Path(last).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(
            f"{last[:60]!r} is no view: use {', '.join(SUFFIXES)} (depth .png with camera.json), or poses.json."
        )
    stem = Path(last).stem
    if SAFE.fullmatch(stem) and f"{stem}{suffix}" not in taken:
        return f"{stem}{suffix}"
    number = 0
    while f"upload-{number}{suffix}" in taken:
        number += 1
    return f"upload-{number}{suffix}"


def take(inspection: Inspection, temporary: Path, given: Any) -> dict[str, Any]:
    """Check the received file and move it into 1-views; the temporary file is gone afterwards.

    Raises InputError or FileError when it is not what its name says.
    """
    try:
        folder = inspection.step_folder("views")
        folder.mkdir(exist_ok=True)
        present = {path.name for path in folder.iterdir()}
        name = safe_name(given, present)
        if len(inspection.view_files()) >= MAX_VIEWS and name not in BESIDE:
            raise InputError(f"the inspection holds {MAX_VIEWS} views already, which is the limit. Make another one.")
        check_content(temporary, name)
        temporary.chmod(0o644)
        temporary.replace(folder / name)
        inspection.log("upload", file=name, bytes=(folder / name).stat().st_size)
        return {"file": name, "renamed": name != str(given)}
    finally:
        temporary.unlink(missing_ok=True)


def check_content(path: Path, name: str) -> None:
    """Raise FileError when the content is not of the kind that the name says."""
    if name in BESIDE:
        _check_json(path, name)
        return
    suffix = Path(name).suffix
    with path.open("rb") as file:
        head = file.read(4096)
    if not head:
        raise FileError(f"{name} is empty. Export it again.")
    if suffix in MAGIC:
        good = head.startswith(MAGIC[suffix])
    elif suffix == ".pcd":
        good = b"VERSION" in head and b"FIELDS" in head
    else:
        good = _numbers(head)
    if not good:
        raise FileError(f"{name} is no {suffix[1:].upper()} file: its beginning is of another kind. Export it again.")


def _check_json(path: Path, name: str) -> None:
    if path.stat().st_size > MAX_JSON_BYTES:
        raise FileError(f"{name} has {path.stat().st_size} bytes, the limit is {MAX_JSON_BYTES}. Is it the right file?")
    try:
        value = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise FileError(f"{name} is no valid JSON: {error}. Export it again.") from None
    if not isinstance(value, (dict, list)):
        raise FileError(f"{name} holds no JSON object. Export it again.")


def _numbers(head: bytes) -> bool:
    try:
        first = next(line for line in head.decode("ascii").splitlines() if line.strip() and line[0] not in "#/")
        return len([float(word) for word in first.replace(",", " ").split()]) >= 3
    except (UnicodeDecodeError, ValueError, StopIteration):
        return False
