"""The C-scan as vertex data of a binary PLY: any mesh viewer shows it, and it reads back whole."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.frames import Array, BoolArray, IntArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.record import ScanRecord
from eddyscan.formats.record_atomic import replacing

TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "<i2",
    "int16": "<i2",
    "ushort": "<u2",
    "uint16": "<u2",
    "int": "<i4",
    "int32": "<i4",
    "uint": "<u4",
    "uint32": "<u4",
    "float": "<f4",
    "float32": "<f4",
    "double": "<f8",
    "float64": "<f8",
}
GEOMETRY = ("x", "y", "z", "nx", "ny", "nz")
UNCERTAINTY = "uncertainty_mm"
COVERED = "covered"
END = b"end_header\n"


def write_cscan_ply(cscan: CScan, path: Path | str) -> None:
    """Write mesh and channels; a vertex no reading speaks for keeps its value and has covered = 0.

    Every channel becomes a double property named as in the C-scan (units in the
    name); positions and normals are in mm, part frame.
    """
    path, mesh = Path(path), cscan.mesh
    bad = [name for name in cscan.channels if not re.fullmatch(r"\w+", name) or name in (*GEOMETRY, COVERED)]
    if bad:
        raise GeometryError(f"C-scan channel {bad[0]!r} cannot be a PLY property; rename it to plain letters.")
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    columns |= dict(zip(("nx", "ny", "nz"), mesh.normals.T, strict=True))
    if mesh.uncertainty_mm is not None:
        columns[UNCERTAINTY] = mesh.uncertainty_mm
    columns |= cscan.channels
    vertex = np.empty(len(mesh.vertices), dtype=[*((name, "<f8") for name in columns), (COVERED, "u1")])
    for name, values in columns.items():
        vertex[name] = values
    vertex[COVERED] = cscan.covered
    face = np.empty(len(mesh.faces), dtype=[("corners", "u1"), ("index", "<i4", 3)])
    face["corners"], face["index"] = 3, mesh.faces
    with replacing(path) as draft:
        draft.write_bytes(
            _header(list(columns), len(vertex), len(face), mesh.frame) + vertex.tobytes() + face.tobytes()
        )


def _header(columns: list[str], vertices: int, faces: int, frame: str) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", "comment eddyscan C-scan", f"comment frame {frame}"]
    lines += [f"element vertex {vertices}", *(f"property double {name}" for name in columns)]
    lines += [f"property uchar {COVERED}", f"element face {faces}", "property list uchar int vertex_indices"]
    return ("\n".join(lines) + "\n").encode("ascii") + END


def write_record_ply(record: ScanRecord, path: Path | str, *, lift_off_mm: Array | None = None) -> None:
    """Write the coil positions [mm, part] as points with the readings as properties."""
    columns: dict[str, Array] = dict(zip("xyz", record.part_mm.T, strict=True))
    columns |= {"resistance_ohm": record.impedance_ohm.real, "reactance_ohm": record.impedance_ohm.imag}
    if lift_off_mm is not None:
        columns["lift_off_mm"] = lift_off_mm
    columns |= {name: getattr(record, name).astype(np.float64) for name in ("time_s", "row", "point", "flag")}
    table = np.stack(list(columns.values()), axis=1)
    lines = ["ply", "format binary_little_endian 1.0", "comment eddyscan readings", "comment frame part"]
    lines += [f"element vertex {len(record)}", *(f"property double {name}" for name in columns)]
    with replacing(Path(path)) as draft:
        draft.write_bytes(("\n".join(lines) + "\n").encode("ascii") + END + table.astype("<f8").tobytes())


def read_cscan_ply(path: Path | str) -> CScan:
    """Read what `write_cscan_ply` wrote.

    Raises
    ------
    FileError
        When the file is missing, empty, truncated, or no binary PLY with a C-scan.
    """
    path = Path(path)
    if not path.is_file():
        raise FileError(f"there is no C-scan {path}. Analyse the record first, or check the path.")
    data = path.read_bytes()
    if not data.startswith(b"ply") or END not in data:
        raise FileError(f"{path} ({len(data)} bytes) is not a PLY file with a C-scan. Check the path.")
    head, body = data.split(END, 1)
    header = head.decode("ascii", errors="replace")
    vertex, faces = _elements(path, header, body)
    names = vertex.dtype.names or ()
    missing = [name for name in (*GEOMETRY, COVERED) if name not in names]
    if missing:
        raise FileError(f"{path} has no vertex property {missing[0]!r}, so it is a mesh without C-scan. Analyse again.")
    channels = {name: _column(vertex, name) for name in names if name not in (*GEOMETRY, COVERED, UNCERTAINTY)}
    mesh = SurfaceMesh(
        np.stack([_column(vertex, name) for name in "xyz"], axis=1),
        faces,
        np.stack([_column(vertex, name) for name in ("nx", "ny", "nz")], axis=1),
        _column(vertex, UNCERTAINTY) if UNCERTAINTY in names else None,
        _frame(header),
    )
    covered: BoolArray = vertex[COVERED].astype(bool)
    return CScan(mesh, covered, channels)


def _column(vertex: np.ndarray, name: str) -> Array:
    return np.ascontiguousarray(vertex[name], dtype=np.float64)


def _frame(header: str) -> str:
    found = re.search(r"^comment frame (\S+)$", header, re.MULTILINE)
    return found.group(1) if found else "part"


def _elements(path: Path, header: str, body: bytes) -> tuple[np.ndarray, IntArray]:
    """Cut the body into the vertex table and the (F, 3) faces."""
    counts = dict(re.findall(r"^element (vertex|face) (\d+)$", header, re.MULTILINE))
    properties = re.findall(r"^property (\w+) (\w+)$", header, re.MULTILINE)
    known = all(kind in TYPES for kind, _ in properties)
    if "binary_little_endian" not in header or len(counts) != 2 or not properties or not known:
        raise FileError(f"{path} is not a binary little-endian PLY mesh. Write it again with eddyscan.")
    table = np.dtype([(name, TYPES[kind]) for kind, name in properties])
    face = np.dtype([("corners", "u1"), ("index", "<i4", 3)])
    split = int(counts["vertex"]) * table.itemsize
    needed = split + int(counts["face"]) * face.itemsize
    if len(body) < needed:
        raise FileError(f"{path} is truncated: {len(body)} of {needed} bytes of data. Write it again, or restore it.")
    faces = np.frombuffer(body[split:needed], dtype=face)
    if (faces["corners"] != 3).any():
        raise FileError(f"{path} holds faces that are not triangles. Write it again with eddyscan.")
    return np.frombuffer(body[:split], dtype=table), faces["index"].astype(np.int64)
