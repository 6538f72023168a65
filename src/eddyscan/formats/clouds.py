"""Point cloud files: PLY, PCD, XYZ, E57 -> PointCloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from eddyscan.core.cloud import PointCloud
from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.formats.ply import read_ply, write_ply

READABLE = (".ply", ".pcd", ".xyz", ".e57")
PCD_TYPES = {("F", "4"): "<f4", ("F", "8"): "<f8", ("U", "1"): "u1", ("U", "2"): "<u2", ("U", "4"): "<u4",
             ("I", "1"): "i1", ("I", "2"): "<i2", ("I", "4"): "<i4"}  # fmt: skip


def read_cloud(path: Path | str) -> PointCloud:
    """Read a point cloud [mm, camera frame]; points with NaN or infinite entries are left out and counted.

    Raises
    ------
    FileError
        Missing, empty, truncated, of another kind, or without a finite point.
    """
    path = Path(path)
    if not path.exists():
        raise FileError(f"{path} does not exist. Check the name.")
    kind = path.suffix.lower()
    if path.is_dir() or kind not in READABLE:
        raise FileError(f"{path} is no point cloud file; readable are {', '.join(READABLE)}.")
    if path.stat().st_size == 0:
        raise FileError(f"{path} is empty (0 bytes). Export it again.")
    points, normals = {".ply": _ply, ".pcd": _pcd, ".xyz": _xyz, ".e57": _e57}[kind](path)
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise FileError(f"{path} holds {len(points)} points, none of them finite. Export it again.")
    dropped = int(len(points) - finite.sum())
    kept = None if normals is None else normals[finite]
    return PointCloud(points[finite], "camera", kept, path.name, dropped)


def write_cloud(cloud: PointCloud, path: Path | str) -> None:
    """Write a cloud as binary PLY, or as E57 or XYZ by the file's suffix."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() == ".e57":
        import pye57

        with pye57.E57(str(path), mode="w") as file:
            file.write_scan_raw({f"cartesian{c}": cloud.points[:, k] / 1000.0 for k, c in enumerate("XYZ")})
    elif path.suffix.lower() == ".xyz":
        np.savetxt(path, cloud.points, fmt="%.5f")
    else:
        columns = {name: cloud.points[:, k] for k, name in enumerate("xyz")}
        if cloud.normals is not None:
            columns |= {name: cloud.normals[:, k] for k, name in enumerate(("nx", "ny", "nz"))}
        write_ply(path, columns, None, (f"frame {cloud.frame}", "unit mm"))


def _ply(path: Path) -> tuple[Array, Array | None]:
    data = read_ply(path, path.read_bytes())
    points = data.columns("x", "y", "z")
    if points is None:
        raise FileError(f"{path} has vertices without x, y, z. Export it again.")
    return points, data.columns("nx", "ny", "nz")


def _xyz(path: Path) -> tuple[Array, Array | None]:
    text = path.read_bytes().decode("ascii", "replace").replace(",", " ").replace(";", " ")
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith(("#", "//"))]
    try:
        table = np.array([row[:3] for row in rows], dtype=np.float64)
    except ValueError as error:
        raise FileError(
            f"{path} is not a table of x y z numbers: {error}. One point per line, blanks between."
        ) from None
    if table.ndim != 2 or table.shape[1] != 3:
        raise FileError(f"{path} has lines with fewer than 3 numbers; one point per line is x y z.")
    return table, None


def _pcd(path: Path) -> tuple[Array, Array | None]:
    data = path.read_bytes()
    head: dict[str, list[str]] = {}
    at = 0
    while at < len(data) and "DATA" not in head:
        end = data.find(b"\n", at)
        end = len(data) if end < 0 else end
        words = data[at:end].decode("ascii", "replace").split()
        if words and not words[0].startswith("#"):
            head[words[0].upper()] = words[1:]
        at = end + 1
    if "FIELDS" not in head or "DATA" not in head or not {"x", "y", "z"} <= set(head["FIELDS"]):
        raise FileError(f"{path} is not a PCD file with x, y, z fields. Export it again.")
    try:
        return _pcd_body(path, data[at:], head), None
    except (KeyError, ValueError) as error:
        raise FileError(f"{path} has a PCD header or body that cannot be read: {error}. Export it again.") from None


def _pcd_body(path: Path, body: bytes, head: dict[str, list[str]]) -> Array:
    fields, count = head["FIELDS"], int(head["POINTS"][0])
    repeat = [int(c) for c in head.get("COUNT", ["1"] * len(fields))]
    if head["DATA"][0] == "ascii":
        table = np.array(
            [row.split() for row in body.decode("ascii", "replace").splitlines() if row.strip()], dtype=float
        )
        if len(table) < count:
            raise FileError(f"{path} is truncated: {count} points promised, {len(table)} there. Copy it again.")
        starts = np.concatenate([[0], np.cumsum(repeat)])
        return np.stack([table[:count, starts[fields.index(c)]] for c in "xyz"], axis=1)
    if head["DATA"][0] != "binary":
        raise FileError(f"{path} is PCD DATA {head['DATA'][0]}; readable are ascii and binary. Save it uncompressed.")
    kinds = [PCD_TYPES[t, s] for t, s in zip(head["TYPE"], head["SIZE"], strict=True)]
    dtype = np.dtype(
        [(f"{k}_{f}", kind, (n,)) for k, (f, kind, n) in enumerate(zip(fields, kinds, repeat, strict=True))]
    )
    if len(body) < dtype.itemsize * count:
        raise FileError(
            f"{path} is truncated: {count} points need {dtype.itemsize * count} bytes, {len(body)} are there. "
            "Copy it again."
        )
    table = np.frombuffer(body, dtype, count)
    return np.stack([table[f"{fields.index(c)}_{c}"][:, 0].astype(np.float64) for c in "xyz"], axis=1)


def _e57(path: Path) -> tuple[Array, Array | None]:
    """Read every scan of an E57 file; the standard fixes metres, the result is mm."""
    import pye57

    try:
        with pye57.E57(str(path)) as file:
            scans = [file.read_scan(k, ignore_missing_fields=True, transform=True) for k in range(file.scan_count)]
    except Exception as error:  # the binding raises its own untyped errors
        raise FileError(f"{path} cannot be read as E57: {str(error).splitlines()[0]}. Export it again.") from None
    if not scans:
        raise FileError(f"{path} holds no scan. Export it again.")
    points = np.concatenate([np.stack([s[f"cartesian{c}"] for c in "XYZ"], axis=1) for s in scans])
    return points.astype(np.float64) * 1000.0, None
