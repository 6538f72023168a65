"""Records made elsewhere: a table of positions and complex readings on a flat part."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
from scipy.spatial import Delaunay

from eddyscan.analysis.mapping import map_to_surface
from eddyscan.core.cscan import CScan
from eddyscan.core.errors import FileError
from eddyscan.core.frames import Array, BoolArray, ComplexArray
from eddyscan.core.mesh import SurfaceMesh
from eddyscan.core.record import ScanRecord

FREQUENCY = re.compile(r"(\d+(?:\.\d+)?(?:e\d+)?)\s*hz", re.IGNORECASE)
NEW_ROW_MM = 2.0


def foreign_record(text: str, *, name: str = "the table") -> dict[float, ScanRecord]:
    """Read positions and complex readings from CSV text, one record per frequency.

    The first two columns are x and y [mm]; every column whose heading names a
    frequency in Hz holds complex numbers written as text, "(a+bj)", in the
    instrument's own units (not ohm unless it says so).

    Parameters
    ----------
    text : str
    name : str
        Named in errors.

    Returns
    -------
    dict of frequency [Hz] -> ScanRecord
        Stage and part frame are one; a new row begins at every jump or turn.

    Raises
    ------
    FileError
        Empty, no frequency in the headings, or a line that cannot be read (its number is told).
    """
    lines = list(csv.reader(io.StringIO(text)))
    if len(lines) < 2:
        raise FileError(f"{name} holds {max(len(lines) - 1, 0)} readings; a heading and at least one line are needed.")
    columns = {k: float(hit[1]) for k, head in enumerate(lines[0]) if (hit := FREQUENCY.search(head))}
    if not columns:
        raise FileError(
            f"{name} has no column with a frequency; its headings are {', '.join(lines[0])}. "
            'Name the signal columns like "12e6 Hz".'
        )
    place = np.empty((len(lines) - 1, 3))
    signal = np.empty((len(lines) - 1, len(columns)), dtype=np.complex128)
    for number, line in enumerate(lines[1:]):
        try:
            place[number] = (float(line[0]), float(line[1]), 0.0)
            signal[number] = [complex(line[k].replace(" ", "").replace("i", "j")) for k in columns]
        except (ValueError, IndexError):
            raise FileError(
                f"line {number + 2} of {name} is not x, y and {len(columns)} complex readings: "
                f"{','.join(line)[:80]!r}. Mend or remove it."
            ) from None
    return {f: _record(place, signal[:, k], f) for k, f in enumerate(columns.values())}


def flat_map(record: ScanRecord, *, reach_mm: float | None = None) -> CScan:
    """Map a flat record on a sheet through its own positions; gaps stay uncovered.

    Channels: "amplitude" and "phase_deg" of the reading, "air" (1 where no metal is
    below, between 0 and 1 near its edge).
    """
    foot = record.part_mm
    spacing = float(np.median(np.linalg.norm(np.diff(foot, axis=0), axis=1)))
    reach = 4 * spacing if reach_mm is None else reach_mm
    low, high = foot[:, :2].min(axis=0), foot[:, :2].max(axis=0)
    x, y = (np.arange(a, b + reach / 2, reach / 2) for a, b in zip(low, high, strict=True))
    X, Y = np.meshgrid(x, y, indexing="ij")
    vertices = np.stack([X.ravel(), Y.ravel(), 0 * X.ravel()], axis=1)
    faces = Delaunay(vertices[:, :2]).simplices
    mesh = SurfaceMesh.from_triangles(vertices, np.asarray(faces, dtype=np.int64))
    values = {
        "amplitude": np.abs(record.impedance_ohm),
        "phase_deg": np.degrees(np.angle(record.impedance_ohm)),
        "air": over_air(record).astype(np.float64),
    }
    return map_to_surface(mesh, foot, values, reach_mm=reach)


def over_air(record: ScanRecord) -> BoolArray:
    """Return (N,) bool: readings with no metal below (beside the part or over a hole).

    The signal has two levels, metal and none; the quieter one is air, where
    neither lift-off nor material varies.
    """
    value = record.impedance_ohm
    first, second = value[np.argmin(np.abs(value))], value[np.argmax(np.abs(value))]
    nearer = np.ones(len(value), dtype=bool)
    for _ in range(20):
        nearer = np.abs(value - first) < np.abs(value - second)
        if nearer.all() or not nearer.any():
            break
        first, second = complex(value[nearer].mean()), complex(value[~nearer].mean())
    spread = [float(np.std(value[mask])) for mask in (nearer, ~nearer)]
    return np.asarray(nearer if spread[0] < spread[1] else ~nearer)


def edges_along_path(record: ScanRecord) -> BoolArray:
    """Return (N,) bool: first readings behind an edge of the metal, outer edge or hole, along the path."""
    air = over_air(record)
    same = np.diff(record.row, prepend=-1) == 0
    return np.asarray(same & (air != np.roll(air, 1)))


def _record(place: Array, signal: ComplexArray, frequency_hz: float) -> ScanRecord:
    turn = np.zeros(len(place), dtype=bool)
    step = np.diff(place[:, :2], axis=0)
    length = np.linalg.norm(step, axis=1)
    bend = (step[1:] * step[:-1]).sum(axis=1) < 0.5 * length[1:] * length[:-1]
    jump = length > NEW_ROW_MM
    turn[1:] = jump
    turn[2:] |= bend & ~jump[1:] & ~jump[:-1]
    row = np.cumsum(turn)
    first = np.searchsorted(row, row)
    n = len(place)
    return ScanRecord(
        row.astype(np.int64),
        (np.arange(n) - first).astype(np.int64),
        np.arange(n, dtype=np.float64),
        place,
        place.copy(),
        np.full(n, frequency_hz),
        np.asarray(signal, dtype=np.complex128),
        np.zeros(n, dtype=np.int64),
        {"T_stage_part": np.eye(4).tolist(), "source": "imported table, instrument units"},
    )
