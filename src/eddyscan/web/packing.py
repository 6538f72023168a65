"""Arrays for the page in one piece: a JSON head that names them, then their bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from eddyscan.core.plain import plain

ALIGN = 8
KINDS = {"f4": "float32", "f8": "float64", "u4": "uint32", "i4": "int32", "u1": "uint8"}


def packed(arrays: Mapping[str, Any], facts: Mapping[str, Any]) -> bytes:
    """Return head length (uint32), head, padding, then the arrays, each on a multiple of 8 bytes.

    The head is {"facts": ..., "arrays": {name: {"type", "shape", "offset"}}}; offsets
    count from the end of the padded head. All little-endian.
    """
    entries: dict[str, Any] = {}
    pieces: list[bytes] = []
    offset = 0
    for name, array in arrays.items():
        array = np.ascontiguousarray(array)
        kind = array.dtype.str[1:]
        data = array.astype(array.dtype.newbyteorder("<")).tobytes()
        entries[name] = {"type": KINDS[kind], "shape": list(array.shape), "offset": offset}
        pieces.append(_padded(data))
        offset += len(pieces[-1])
    head = json.dumps({"facts": plain(dict(facts)), "arrays": entries}, allow_nan=False, default=str).encode()
    head += b" " * (-(4 + len(head)) % ALIGN)
    return len(head).to_bytes(4, "little") + head + b"".join(pieces)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % ALIGN)
