"""Rows on disk: Parquet parts written as they come, read back to go on."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from eddyscan.core.errors import FileError
from eddyscan.inspection import read_json, write_json


class RowStore:
    """A folder of Parquet parts, each complete or absent; every row carries its `case` number."""

    def __init__(self, folder: Path, identity: Mapping[str, str]) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        note = folder / "campaign.json"
        if note.is_file():
            held = read_json(note)
            changed = [key for key in identity if held.get(key) != identity[key]]
            if changed:
                raise FileError(
                    f"{folder} holds rows of another campaign ({', '.join(changed)} differ). Name another --out."
                )
        else:
            write_json(note, dict(identity))

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Write rows as one part that is durable on return."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        if not rows:
            return
        part = self.folder / f"rows-{min(int(row['case']) for row in rows):08d}-{uuid.uuid4().hex[:8]}.parquet"
        temporary = part.with_suffix(".tmp")
        table = pa.Table.from_pylist([dict(row) for row in rows])
        for number, field in enumerate(table.schema):  # a figure no row of this part has is still a number
            if pa.types.is_null(field.type):
                table = table.set_column(number, field.name, table.column(number).cast(pa.float64()))
        pq.write_table(table, temporary)
        _to_disk(temporary)
        temporary.replace(part)
        _to_disk(self.folder)

    @contextmanager
    def owned(self) -> Iterator[None]:
        """Hold the folder against a second campaign; the hold ends with the process, however that ends."""
        try:
            import fcntl
        except ImportError:  # a system without file locks
            yield
            return
        with (self.folder / "lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise FileError(
                    f"another campaign is writing to {self.folder} at this moment. Wait for it, or name another --out."
                ) from None
            yield

    def done(self) -> set[int]:
        """Return the case numbers that have a row."""
        import pyarrow.parquet as pq

        return {
            int(case) for part in self._parts() for case in pq.read_table(part, columns=["case"])["case"].to_pylist()
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return all rows in the order of their cases."""
        import pyarrow.parquet as pq

        rows = [row for part in self._parts() for row in pq.read_table(part).to_pylist()]
        return sorted(rows, key=lambda row: int(row["case"]))

    def _parts(self) -> list[Path]:
        return sorted(self.folder.glob("rows-*.parquet"))


def _to_disk(path: Path) -> None:
    """Make a file's content, or a folder's names, survive a power cut."""
    if path.is_dir() and os.name == "nt":
        return
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
