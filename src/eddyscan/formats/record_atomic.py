"""A file appears whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from eddyscan.core.errors import FileError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a path beside `path` to write to; it takes `path`'s place when the block ends well.

    Raises
    ------
    FileError
        When the folder does not exist or refuses the file.
    """
    if not path.parent.is_dir():
        raise FileError(f"cannot write {path}: the folder {path.parent} does not exist. Make it first.")
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield draft
        os.replace(draft, path)
    except OSError as fault:
        raise FileError(f"cannot write {path}: {fault.strerror or fault}. Choose another place with --out.") from fault
    finally:
        draft.unlink(missing_ok=True)
