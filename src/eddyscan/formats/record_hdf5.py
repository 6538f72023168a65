"""The archive: record, C-scan and everything noted in one HDF5 file that explains itself.

Every array carries its unit, frame and meaning as attributes, so the file can be
read in thirty years with any HDF5 library and no other document.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eddyscan.core.cscan import CScan
from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.record import ScanRecord
from eddyscan.formats.record_atomic import replacing
from eddyscan.formats.record_json import to_json

FORMAT, VERSION = "eddyscan archive", 1
READINGS: dict[str, tuple[str, str, str]] = {
    "row": ("1", "", "row number from 0"),
    "point": ("1", "", "number within the row from 0"),
    "time_s": ("s", "", "since the scan began, the rig's clock"),
    "stage_mm": ("mm", "stage", "measured axis positions x, y, z"),
    "target_mm": ("mm", "stage", "commanded axis positions x, y, z"),
    "part_mm": ("mm", "part", "coil-face centre x, y, z"),
    "frequency_hz": ("Hz", "", "drive frequency"),
    "impedance_ohm": ("ohm", "", "as read, unrotated, e^{+j w t}"),
    "flag": ("1", "", "bits: 1 overload, 2 out of range, 4 position doubtful; 0 good"),
}
COLUMNS = tuple(name for name in READINGS if name != "part_mm")


@dataclass(frozen=True)
class Archive:
    """What an archive holds: the record, lift-off per reading [mm] and C-scan when they were written."""

    record: ScanRecord
    lift_off_mm: Array | None = None
    cscan: CScan | None = None


def write_hdf5(
    record: ScanRecord, path: Path | str, *, lift_off_mm: Array | None = None, cscan: CScan | None = None
) -> None:
    """Write an archive; the raw readings are stored bit for bit."""
    import h5py

    with replacing(Path(path)) as draft, h5py.File(draft, "w") as file:
        file.attrs.update({"format": FORMAT, "version": VERSION})
        file["meta"] = to_json(record.meta)
        file["meta"].attrs["description"] = "settings, devices, hashes and events as JSON"
        readings = file.create_group("readings")
        for name, (unit, frame, meaning) in READINGS.items():
            _put(readings, name, getattr(record, name), meaning, unit=unit, frame=frame)
        if lift_off_mm is not None:
            _put(readings, "lift_off_mm", lift_off_mm, "coil to surface along the normal, as analysed", unit="mm")
        if cscan is not None:
            _put_cscan(file, cscan)


def _put(group: Any, name: str, values: Any, meaning: str, *, unit: str = "1", frame: str = "") -> None:
    data = group.create_dataset(name, data=values, compression="gzip" if np.size(values) > 64 else None)
    data.attrs.update({"units": unit, "frame": frame, "description": meaning})


def _put_cscan(file: Any, cscan: CScan) -> None:
    surface, mesh = file.create_group("surface"), cscan.mesh
    surface.attrs["frame"] = mesh.frame
    _put(surface, "vertices", mesh.vertices, "x, y, z", unit="mm", frame=mesh.frame)
    _put(surface, "faces", mesh.faces, "vertex numbers, counter-clockwise from outside")
    _put(surface, "normals", mesh.normals, "unit outward normals", frame=mesh.frame)
    if mesh.uncertainty_mm is not None:
        _put(surface, "uncertainty_mm", mesh.uncertainty_mm, "standard uncertainty along the normal", unit="mm")
    group = file.create_group("cscan")
    _put(group, "covered", cscan.covered, "true where a reading speaks for the vertex")
    channels = group.create_group("channels")
    for name, values in cscan.channels.items():
        _put(channels, name, values, "per vertex of /surface", unit=name.rsplit("_", 1)[-1] if "_" in name else "1")


def read_hdf5(path: Path | str) -> Archive:
    """Read an archive back.

    Raises
    ------
    FileError
        When the file is missing, truncated, or not an archive.
    """
    import h5py

    path = Path(path)
    if not path.is_file():
        raise FileError(f"there is no archive {path}. Check the path.")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise FileError(f"{path} is an HDF5 file of another kind, not an eddyscan archive. Check the path.")
            return _archive(file)
    except (OSError, KeyError) as fault:
        raise FileError(f"{path} cannot be read as an archive: {fault}. It is truncated or of another kind.") from fault


def _archive(file: Any) -> Archive:
    readings = file["readings"]
    columns = {name: readings[name][()] for name in COLUMNS}
    record = ScanRecord(**columns, meta=json.loads(file["meta"][()]))
    lift_off = readings["lift_off_mm"][()] if "lift_off_mm" in readings else None
    return Archive(record, lift_off, _cscan(file) if "cscan" in file else None)


def _cscan(file: Any) -> CScan:
    surface = file["surface"]
    mesh = SurfaceMesh(
        surface["vertices"][()],
        surface["faces"][()],
        surface["normals"][()],
        surface["uncertainty_mm"][()] if "uncertainty_mm" in surface else None,
        str(surface.attrs["frame"]),
    )
    channels = {name: values[()] for name, values in file["cscan/channels"].items()}
    return CScan(mesh, file["cscan/covered"][()], channels)
