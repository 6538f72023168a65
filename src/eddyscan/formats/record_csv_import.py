"""CSV records made elsewhere: positions and complex columns under many names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eddyscan.core.errors import FileError, InputError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.record import POSITION_DOUBTFUL, ScanRecord
from eddyscan.formats.record_csv import HEADER, read_own_csv, read_table
from eddyscan.formats.record_rows import rows_along

SCALES = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
REAL_PARTS = ("resistance", "real", "re", "r")
IMAGINARY_PARTS = ("reactance", "imaginary", "imag", "im")
POSITIONS = ("x", "y", "z")


@dataclass(frozen=True)
class ForeignTable:
    """A table taken apart: positions [mm], time [s] and complex channels by name."""

    positions_mm: Array
    time_s: Array
    channels: dict[str, ComplexArray]


def csv_channels(path: Path | str, *, columns: tuple[str, ...] | None = None) -> tuple[str, ...]:
    """Return the names of the complex channels a CSV record holds."""
    path = Path(path)
    header, lines = _table(path, columns)
    return ("impedance",) if ",".join(header) == HEADER else tuple(_foreign(path, header, lines).channels)


def read_record_csv(
    path: Path | str, *, channel: str | None = None, columns: tuple[str, ...] | None = None
) -> ScanRecord:
    """Read a CSV record: eddyscan's own, or one made elsewhere.

    Foreign tables need columns ``x_mm, y_mm (, z_mm)`` (also "x (mm)" or "x") and
    either complex text such as "(1.5-2j)" or a pair such as ``real, imag``. Values
    keep the units of the file. A frequency is taken from a name such as
    "Spec 11000000.0Hz". Rows are found from gaps and turns of the path.

    Parameters
    ----------
    channel : which complex column, when there are several
    columns : names for the columns of a file without header; "time_s", "real", "imag" suffice,
        positions are then unknown (NaN) and every reading is flagged POSITION_DOUBTFUL

    Raises
    ------
    FileError
        When the file is missing, empty, damaged, or has no complex column.
    InputError
        When it has several and none is chosen.
    """
    path = Path(path)
    header, lines = _table(path, columns)
    if ",".join(header) == HEADER:
        return read_own_csv(path, header, lines)
    table = _foreign(path, header, lines)
    names = ", ".join(repr(name) for name in table.channels)
    if channel is None and len(table.channels) > 1:
        raise InputError(f"{path} holds {len(table.channels)} channels: {names}. Choose one of them.")
    chosen = next(iter(table.channels)) if channel is None else channel
    if chosen not in table.channels:
        raise InputError(f"{path} holds no channel {chosen!r}; it holds {names}.")
    return _record(table, chosen, path)


def _table(path: Path, columns: tuple[str, ...] | None) -> tuple[list[str], list[list[str]]]:
    first, lines = read_table(path)
    if columns is None:
        return first, lines
    if len(columns) != len(first):
        raise InputError(f"{path} has {len(first)} columns, {len(columns)} names were given: {', '.join(columns)}.")
    return list(columns), [first, *lines]


def _plain(name: str) -> str:
    """Return a column's name without unit and case: "x (mm)", "X_mm" and "x" are the same."""
    return re.sub(r"[\s_]*(\(.*\)|\[.*\]|mm|ohm|s)?$", "", name.strip().lower())


def _foreign(path: Path, header: list[str], lines: list[list[str]]) -> ForeignTable:
    values = {name: _column(path, name, [line[k] for line in lines]) for k, name in enumerate(header)}
    plain = {_plain(name): name for name in header if not np.iscomplexobj(values[name])}
    channels: dict[str, ComplexArray] = {
        name: np.asarray(column, dtype=np.complex128) for name, column in values.items() if np.iscomplexobj(column)
    }
    real = next((plain[name] for name in REAL_PARTS if name in plain), None)
    imaginary = next((plain[name] for name in IMAGINARY_PARTS if name in plain), None)
    if real is not None and imaginary is not None:
        channels["impedance"] = np.asarray(values[real] + 1j * values[imaginary], dtype=np.complex128)
    if not channels:
        raise FileError(
            f"{path} has no complex column; its columns are {', '.join(header)}. Needed is complex text such as "
            '"(1.5-2j)" or a pair real, imag.'
        )
    n = len(lines)
    unknown = np.full(n, np.nan)
    place = [values[plain[axis]].real if axis in plain else unknown for axis in POSITIONS]
    if "x" in plain and "y" in plain and "z" not in plain:
        place[2] = np.zeros(n)
    time = next((values[plain[name]].real for name in ("time", "t") if name in plain), np.arange(n, dtype=np.float64))
    return ForeignTable(np.stack(place, axis=1), time, channels)


def _column(path: Path, name: str, cells: list[str]) -> Array | ComplexArray:
    """Return a column as numbers, complex when any cell is."""
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    except ValueError:
        pass
    numbers = np.empty(len(cells), dtype=np.complex128)
    for k, cell in enumerate(cells):
        try:
            numbers[k] = complex(cell.replace(" ", "").replace("i", "j")) if cell.strip() else np.nan
        except ValueError:
            raise FileError(f"{path} column {name!r}, reading {k + 1}: {cell!r} is not a number.") from None
    return numbers


def frequency_in(name: str) -> float:
    """Return the frequency a column's name states [Hz], or NaN: "Spec 11.5 MHz" is 11.5e6."""
    found = re.search(r"(\d+(?:\.\d+)?(?:e[+-]?\d+)?)\s*([kMG]?)Hz", name, re.IGNORECASE)
    return float(found.group(1)) * SCALES[found.group(2).lower()] if found else float("nan")


def _record(table: ForeignTable, channel: str, path: Path) -> ScanRecord:
    n = len(table.time_s)
    row, point = rows_along(table.positions_mm)
    placed = np.isfinite(table.positions_mm).all(axis=1)
    return ScanRecord(
        row=row,
        point=point,
        time_s=table.time_s,
        stage_mm=table.positions_mm,
        target_mm=np.full((n, 3), np.nan),
        frequency_hz=np.full(n, frequency_in(channel)),
        impedance_ohm=table.channels[channel],
        flag=np.where(placed, 0, POSITION_DOUBTFUL).astype(np.int64),
        meta={
            "T_stage_part": np.eye(4).tolist(),
            "source": path.name,
            "channel": channel,
            "unit": "as in the file",
        },
    )
