"""Uploads: written to the disk as they come, then checked by the library."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import IO

import tornado.web

from eddyscan.web import uploads
from eddyscan.web.asking import Refused
from eddyscan.web.guarded import Guarded


@tornado.web.stream_request_body
class Upload(Guarded):
    """A file for 1-views, written to the disk as it comes, then checked by the library."""

    _file: IO[bytes] | None = None
    _path: Path | None = None
    _received = 0

    def prepare(self) -> None:
        super().prepare()
        if self._finished or not self.need_operator():
            return
        length = self.request.headers.get("Content-Length")
        size = int(length) if length and length.isdigit() else None
        fault = uploads.refusal(size, uploads.free_bytes(self.door.root))
        if fault:
            self.refuse(411 if size is None else 413, fault)
            self.set_header("Connection", "close")
            return
        self.request.connection.set_max_body_size(uploads.MAX_BYTES)  # type: ignore[union-attr]
        handle, name = tempfile.mkstemp(prefix=".upload-", dir=self.door.root)
        self._file, self._path = os.fdopen(handle, "wb"), Path(name)

    def data_received(self, chunk: bytes) -> None:
        if self._file is not None:
            self._received += len(chunk)
            self._file.write(chunk)

    async def put(self) -> None:
        if self._file is None or self._path is None:
            return
        self._file.close()
        name, given = self.get_query_argument("name", ""), self.get_query_argument("file", "")
        job = self.door.bench.job
        if job is not None and job.active and Path(job.folder).name == name:
            raise Refused(f"{job.told()['title']} of {name} is under way. Wait for it, then add views.", 409)
        value, _ = await self.door.library.ask("take_upload", name=name, given=given, temporary=str(self._path))
        self.door.bench.revision += 1
        self.door.news()
        self.finish(value)

    def on_finish(self) -> None:
        self._clean()

    def on_connection_close(self) -> None:
        super().on_connection_close()
        self._clean()

    def _clean(self) -> None:
        if self._file is not None:
            self._file.close()
        if self._path is not None:
            self._path.unlink(missing_ok=True)
