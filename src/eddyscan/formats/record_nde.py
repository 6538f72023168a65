"""Records as Evident .nde 4.3: HDF5 with JSON tables, for inspection software of other makers.

Impedances, status bits and the three axis readings stand where the format wants
them (every acquisition cycle with its encoders, as for a robot on a free path).
What the format has no place for - rows, times, targets, the part's pose, flags,
notes - stands under ``/Private/eddyscan``, so the record reads back whole.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from eddyscan import __version__
from eddyscan.core.errors import FileError, GeometryError
from eddyscan.core.frames import Array
from eddyscan.core.record import OVERLOAD, ScanRecord
from eddyscan.formats.record_atomic import replacing
from eddyscan.formats.record_json import to_json
from eddyscan.formats.record_nde_rules import broken_rules
from eddyscan.formats.record_nde_setup import HAS_DATA, SATURATED, dataset_path, drive_peak_v, properties, setup

PRIVATE = "/Private/eddyscan"
PRIVATE_COLUMNS = ("row", "point", "time_s", "target_mm", "flag", "part_mm")


def write_nde(
    record: ScanRecord, path: Path | str, *, lift_off_mm: Array | None = None, created: datetime | None = None
) -> None:
    """Write a record as .nde; one group per drive frequency.

    Parameters
    ----------
    lift_off_mm : (N,) [mm] goes to /Private, the format has no place for it
    created : date of the file; None takes now (UTC)
    """
    import h5py

    if len(record) == 0:
        raise GeometryError("the record holds no reading, a .nde file needs at least one. Scan first.")
    groups = _groups(record)
    remark = "positions are axis readings of the stage; the pose of the part is in /Private/eddyscan"
    if drive_peak_v(record) == 0:
        remark += "; the drive amplitude was not recorded"
    tables = {
        "/Properties": properties(created or datetime.now(UTC), __version__, remark),
        "/Public/Setup": setup(record, [(f, record.impedance_ohm[chosen]) for f, chosen in groups]),
    }
    for name, table in tables.items():
        broken = broken_rules(name, table)
        if broken:
            raise GeometryError(f"this record cannot be a .nde file: {name} {broken[0]}. Export it as hdf5 or csv.")
    with replacing(Path(path)) as draft, h5py.File(draft, "w") as file:
        for name, table in tables.items():
            file[name] = to_json(table, indent=1)
        for k, (_, chosen) in enumerate(groups):
            _put_group(file, k, record, chosen)
        _put_private(file, record, groups, lift_off_mm)


def _groups(record: ScanRecord) -> list[tuple[float, np.ndarray]]:
    """Return (frequency, indices of its readings) in ascending order; an unknown frequency becomes 0."""
    frequency = np.nan_to_num(record.frequency_hz, nan=0.0)
    return [(float(f), np.flatnonzero(frequency == f)) for f in np.unique(frequency)]


def _put_group(file: Any, k: int, record: ScanRecord, chosen: np.ndarray) -> None:
    z = record.impedance_ohm[chosen]
    status = np.where(np.isfinite(z), HAS_DATA, 0) | np.where(record.flag[chosen] & OVERLOAD, SATURATED, 0)
    file[dataset_path(k, "0-Impedance")] = z[None, :]
    file[dataset_path(k, "1-ImpedanceStatus")] = status[None, :].astype(np.uint8)
    for axis in range(3):
        file[dataset_path(k, f"{2 + axis}-Encoder")] = 1e-3 * record.stage_mm[chosen, axis]


def _put_private(
    file: Any, record: ScanRecord, groups: list[tuple[float, np.ndarray]], lift_off_mm: Array | None
) -> None:
    private = file.create_group(PRIVATE)
    for name in PRIVATE_COLUMNS:
        private[name] = getattr(record, name)
    private["stage_mm"] = record.stage_mm
    private["frequency_hz"] = record.frequency_hz
    private["reading"] = np.concatenate([chosen for _, chosen in groups])
    private["meta"] = to_json(record.meta)
    if lift_off_mm is not None:
        private["lift_off_mm"] = lift_off_mm


def read_nde(path: Path | str) -> ScanRecord:
    """Read the eddy-current data of a .nde file, eddyscan's or another maker's.

    From another maker's file the first eddy-current group and channel are taken;
    positions are its encoders in the order x, y, z (0 where there are fewer).

    Raises
    ------
    FileError
        When the file is missing, truncated, of another kind, or holds no impedance.
    """
    import h5py

    path = Path(path)
    if not path.is_file():
        raise FileError(f"there is no file {path}. Check the path.")
    try:
        with h5py.File(path, "r") as file:
            if "Public/Setup" not in file:
                raise FileError(f"{path} is an HDF5 file without /Public/Setup, so it is no .nde file. Check the path.")
            table = json.loads(file["Public/Setup"][()])
            return _own(file, table) if PRIVATE in file else _foreign(file, table, path)
    except (OSError, KeyError, json.JSONDecodeError) as fault:
        raise FileError(f"{path} cannot be read as .nde: {fault}. It is truncated or of another kind.") from fault


def _own(file: Any, table: dict[str, Any]) -> ScanRecord:
    private = file[PRIVATE]
    order = private["reading"][()]
    z = np.concatenate([file[dataset_path(k, "0-Impedance")][0] for k in range(len(table["groups"]))])
    impedance = np.empty_like(z)
    impedance[order] = z
    columns = {name: private[name][()] for name in ("row", "point", "time_s", "target_mm", "flag")}
    return ScanRecord(
        **columns,
        stage_mm=private["stage_mm"][()],
        frequency_hz=private["frequency_hz"][()],
        impedance_ohm=impedance,
        meta=json.loads(private["meta"][()]),
    )


def _foreign(file: Any, table: dict[str, Any], path: Path) -> ScanRecord:
    found = next(
        (
            (process, dataset)
            for group in table["groups"]
            for process in group.get("processes", [])
            if "eddyCurrent" in process
            for dataset in group.get("datasets", [])
            if dataset.get("dataClass") == "Impedance"
        ),
        None,
    )
    if found is None:
        raise FileError(f"{path} holds no eddy-current impedance; its method is another one.")
    process, dataset = found
    raw = file[dataset["path"]][0]
    z = raw["r"] + 1j * raw["i"] if raw.dtype.names else np.asarray(raw, dtype=np.complex128)
    n = len(z)
    rate = float(table.get("acquisitionUnits", [{}])[0].get("acquisitionRate", 1.0))
    return ScanRecord(
        row=np.zeros(n, dtype=np.int64),
        point=np.arange(n),
        time_s=np.arange(n) / rate,
        stage_mm=_encoders(file, table, int(process["dataMappingId"]), n),
        target_mm=np.full((n, 3), np.nan),
        frequency_hz=np.full(n, float(process["eddyCurrent"]["frequency"])),
        impedance_ohm=np.asarray(z, dtype=np.complex128),
        flag=np.zeros(n, dtype=np.int64),
        meta={"T_stage_part": np.eye(4).tolist(), "source": path.name, "unit": dataset["dataValue"]["unit"]},
    )


def _encoders(file: Any, table: dict[str, Any], mapping_id: int, cycles: int) -> Array:
    """Return (N, 3) positions [mm] from the encoder datasets of a mapping; a missing axis is 0."""
    positions = np.zeros((cycles, 3))
    mapping: dict[str, Any] = next((m for m in table.get("dataMappings", []) if m["id"] == mapping_id), {})
    for axis, dataset in enumerate(mapping.get("allCycle", {}).get("datasets", [])[:3]):
        span, raw = dataset["dataValue"], np.asarray(file[dataset["path"]][()], dtype=np.float64)
        reach = span["max"] - span["min"]
        scale = (span["unitMax"] - span["unitMin"]) / reach if reach else 1.0
        positions[:, axis] = 1e3 * ((raw - span["min"]) * scale + span["unitMin"])
    return positions
