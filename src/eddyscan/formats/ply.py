"""Binary and ASCII PLY: header, vertex and face elements, any scalar properties."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array, IntArray

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class PlyData:
    """Vertex properties by name (each (V,)) and triangles (F, 3); polygons are split into fans."""

    vertex: dict[str, Array]
    faces: IntArray

    def columns(self, *names: str) -> Array | None:
        """Return the named properties as (V, n), or None when one is missing."""
        if any(n not in self.vertex for n in names):
            return None
        return np.stack([self.vertex[n] for n in names], axis=1)


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    scalars: list[tuple[str, str]]
    lists: list[tuple[str, str, str]]


def read_ply(path: Path, data: bytes) -> PlyData:
    """Parse a PLY file's bytes.

    Raises
    ------
    FileError
        Not a PLY file, an unknown type, or fewer data than its header promises.
    """
    order, elements, offset = _header(path, data)
    if order == "ascii":
        return _ascii(path, data[offset:], elements)
    vertex: dict[str, Array] = {}
    faces = np.zeros((0, 3), dtype=np.int64)
    for element in elements:
        if element.lists:
            if element.name == "face":
                faces, offset = _binary_faces(path, data, offset, element, order)
                continue
            break
        dtype = np.dtype([(name, order + kind) for name, kind in element.scalars])
        _need(path, data, offset, dtype.itemsize * element.count, element)
        table = np.frombuffer(data, dtype, element.count, offset)
        offset += dtype.itemsize * element.count
        if element.name == "vertex":
            vertex = {name: table[name].astype(np.float64) for name, _ in element.scalars}
    return PlyData(vertex, faces)


def _header(path: Path, data: bytes) -> tuple[str, list[_Element], int]:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise FileError(
            f"{path} is not a PLY file: it does not start with 'ply' or has no end_header. Export it again."
        )
    stop = data.index(b"\n", end) + 1 if b"\n" in data[end : end + 16] else end + 10
    order, elements = "", []
    for line in data[:end].decode("ascii", "replace").splitlines():
        word = line.split()
        if not word:
            continue
        if word[0] == "format":
            order = {"ascii": "ascii", "binary_little_endian": "<", "binary_big_endian": ">"}.get(word[1], "")
        elif word[0] == "element":
            elements.append(_Element(word[1], int(word[2]), [], []))
        elif word[0] == "property" and elements:
            if any(w not in TYPES for w in (word[2:4] if word[1] == "list" else word[1:2])):
                raise FileError(f"{path} has a PLY property of unknown type: {line!r}. Known: {', '.join(TYPES)}.")
            if word[1] == "list":
                elements[-1].lists.append((word[4], TYPES[word[2]], TYPES[word[3]]))
            else:
                elements[-1].scalars.append((word[2], TYPES[word[1]]))
    if not order or not any(e.name == "vertex" for e in elements):
        raise FileError(f"{path} has no PLY format line or no vertex element. Export it again.")
    return order, elements, stop


def _need(path: Path, data: bytes, offset: int, size: int, element: _Element) -> None:
    if len(data) < offset + size:
        raise FileError(
            f"{path} is truncated: its {element.count} {element.name} entries need {size} bytes, "
            f"{max(len(data) - offset, 0)} are there. Export or copy it again."
        )


def _binary_faces(path: Path, data: bytes, offset: int, element: _Element, order: str) -> tuple[IntArray, int]:
    if len(element.lists) == 1 and not element.scalars:
        _, count_type, index_type = element.lists[0]
        triangle = np.dtype([("n", order + count_type), ("index", order + index_type, (3,))])
        if len(data) >= offset + triangle.itemsize * element.count:
            table = np.frombuffer(data, triangle, element.count, offset)
            if (table["n"] == 3).all():
                return table["index"].astype(np.int64), offset + triangle.itemsize * element.count
    return _mixed_faces(path, data, offset, element, order)


def _mixed_faces(path: Path, data: bytes, offset: int, element: _Element, order: str) -> tuple[IntArray, int]:
    """Read faces one by one: polygons of any size, other lists and scalars skipped."""
    faces: list[tuple[int, int, int]] = []
    scalar_bytes = sum(np.dtype(kind).itemsize for _, kind in element.scalars)
    for _ in range(element.count):
        for name, count_type, index_type in element.lists:
            head = np.dtype(order + count_type)
            _need(path, data, offset, head.itemsize, element)
            n = int(np.frombuffer(data, head, 1, offset)[0])
            offset += head.itemsize
            body = np.dtype(order + index_type)
            _need(path, data, offset, body.itemsize * n, element)
            corner = np.frombuffer(data, body, n, offset)
            offset += body.itemsize * n
            if name in ("vertex_indices", "vertex_index"):
                faces += [(int(corner[0]), int(corner[k]), int(corner[k + 1])) for k in range(1, n - 1)]
        offset += scalar_bytes
    return np.array(faces, dtype=np.int64).reshape(-1, 3), offset


def _ascii(path: Path, body: bytes, elements: list[_Element]) -> PlyData:
    lines = body.decode("ascii", "replace").split("\n")
    lines = [line for line in lines if line.strip()]
    vertex: dict[str, Array] = {}
    faces: list[tuple[int, int, int]] = []
    at = 0
    for element in elements:
        rows = lines[at : at + element.count]
        at += element.count
        if len(rows) < element.count:
            raise FileError(
                f"{path} is truncated: {element.count} {element.name} lines promised, {len(rows)} there. "
                "Export it again."
            )
        try:
            if element.name == "vertex":
                table = np.array([row.split()[: len(element.scalars)] for row in rows], dtype=np.float64)
                table = table.reshape(element.count, len(element.scalars))
                vertex = {name: table[:, k] for k, (name, _) in enumerate(element.scalars)}
            elif element.name == "face":
                for row in rows:
                    corner = [int(w) for w in row.split()]
                    faces += [(corner[1], corner[k], corner[k + 1]) for k in range(2, corner[0])]
        except (ValueError, IndexError) as error:
            raise FileError(f"{path} has an unreadable {element.name} line: {error}. Export it again.") from None
    return PlyData(vertex, np.array(faces, dtype=np.int64).reshape(-1, 3))


def write_ply(
    path: Path, vertex: dict[str, Array], faces: IntArray | None = None, comments: tuple[str, ...] = ()
) -> None:
    """Write a little-endian binary PLY: x, y, z as double, everything else as float."""
    kinds = {name: "double" if name in "xyz" else "float" for name in vertex}
    count = len(next(iter(vertex.values())))
    table = np.zeros(count, dtype=[(name, "<" + TYPES[kind]) for name, kind in kinds.items()])
    for name, column in vertex.items():
        table[name] = column
    head = ["ply", "format binary_little_endian 1.0", *(f"comment {c}" for c in comments), f"element vertex {count}"]
    head += [f"property {kind} {name}" for name, kind in kinds.items()]
    body = table.tobytes()
    if faces is not None:
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        rows = np.zeros(len(faces), dtype=[("n", "u1"), ("index", "<i4", (3,))])
        rows["n"], rows["index"] = 3, faces
        body += rows.tobytes()
    head.append("end_header\n")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes("\n".join(head).encode("ascii") + body)
