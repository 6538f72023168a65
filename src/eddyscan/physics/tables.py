"""A slot's signal as a table for scans: built once, kept on disk, read a hundred thousand times a second."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline, make_interp_spline

from eddyscan.core.errors import TechniqueError
from eddyscan.core.frames import Array, ComplexArray
from eddyscan.core.progress import Progress, silent
from eddyscan.physics import checks
from eddyscan.physics.coil import MM, Coil
from eddyscan.physics.conductor import Conductor
from eddyscan.physics.slot import Slot
from eddyscan.physics.slot_solver import SlotSolver

MODEL = "thin slot 2"  # part of every key: a change of the physics makes old tables stale


@dataclass(frozen=True)
class TableGrid:
    """Places of the table's nodes in the slot's frame: x, y >= 0 and lift-offs [mm], increasing."""

    x_mm: tuple[float, ...]
    y_mm: tuple[float, ...]
    lift_off_mm: tuple[float, ...]


def table_grid(
    slot: Slot, coil: Coil, *, max_lift_off_mm: float | None = None, counts: tuple[int, int, int] | None = None
) -> TableGrid:
    """Return the usual grid: 2.5 outer radii beyond the slot, to 2 outer radii of lift-off (or as told)."""
    mean = 0.5 * (coil.inner_radius_mm + coil.outer_radius_mm)
    beside = 2.5 * coil.outer_radius_mm
    along = 0.5 * slot.length_mm + beside
    high = 2 * coil.outer_radius_mm if max_lift_off_mm is None else max_lift_off_mm
    checks.positive("max_lift_off_mm", high, unit="mm")
    nx, ny, nh = counts or (max(33, int(along / (0.15 * mean)) + 1), 33, 15)
    scale = 0.6 * mean
    heights = scale * np.expm1(np.linspace(0.0, np.log1p(high / scale), nh))
    heights[-1] = high
    return TableGrid(
        tuple(np.linspace(0.0, along, nx).tolist()),
        tuple(np.linspace(0.0, beside, ny).tolist()),
        tuple(heights.tolist()),
    )


class SlotTable:
    """dZ of one coil over one slot on a grid, evaluated by a tensor cubic spline.

    Symmetric about both axes of the slot, so the grid covers a quarter.

    Attributes
    ----------
    grid : TableGrid
    values : (X, Y, H) complex128 [ohm]
    peak_ohm : largest |dZ| in the table
    rim_fraction : largest |dZ| on the outer x, y rim at the same lift-off as the peak, over the peak
    """

    def __init__(self, grid: TableGrid, values: ComplexArray) -> None:
        self.grid, self.values = grid, values
        size = np.abs(values)
        self.peak_ohm = float(size.max())
        level = size[:, :, int(np.unravel_index(size.argmax(), size.shape)[2])]
        self.rim_fraction = float(max(level[-1].max(), level[:, -1].max()) / self.peak_ohm)
        knots: list[Array] = []
        coefficients: Any = values
        even_then_free: Any = ("clamped", "natural")
        axes = ((grid.x_mm, even_then_free), (grid.y_mm, even_then_free), (grid.lift_off_mm, None))
        for axis, (nodes, ends) in enumerate(axes):
            spline = make_interp_spline(np.asarray(nodes), coefficients, k=3, axis=axis, bc_type=ends)
            knots.append(np.asarray(spline.t))
            coefficients = np.moveaxis(spline.c, 0, axis)
        self._spline = NdBSpline(tuple(knots), np.ascontiguousarray(coefficients), 3)

    def change_ohm(
        self, x_mm: ArrayLike, y_mm: ArrayLike, lift_off_mm: ArrayLike, *, beyond_is_zero: bool = False
    ) -> ComplexArray:
        """Return dZ (...) [ohm] at coil positions in the slot's frame.

        Parameters
        ----------
        x_mm, y_mm, lift_off_mm : (...) float64 [mm], broadcast together
        beyond_is_zero : bool
            Return 0 outside the table (a reading that no longer sees this slot)
            instead of raising; `rim_fraction` says what is cut off.

        Raises
        ------
        TechniqueError
            A position outside the table, naming which, where and the range.
        """
        x, y, h = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x_mm, y_mm, lift_off_mm)))
        points = np.stack([np.abs(x).ravel(), np.abs(y).ravel(), h.ravel()], axis=1)
        low = np.array([0.0, 0.0, self.grid.lift_off_mm[0]])
        high = np.array([self.grid.x_mm[-1], self.grid.y_mm[-1], self.grid.lift_off_mm[-1]])
        inside = ((points >= low) & (points <= high)).all(axis=1)
        if beyond_is_zero:
            checks.lift_offs(points[:, 2])
        elif not inside.all():
            raise TechniqueError(_outside(points, low, high))
        result = np.zeros(len(points), dtype=np.complex128)
        result[inside] = self._spline(points[inside])
        return result.reshape(x.shape)


def _outside(points: Array, low: Array, high: Array) -> str:
    worst = int(np.argmax(~((points >= low) & (points <= high)).all(axis=1)))
    names = ("|x_mm|", "|y_mm|", "lift_off_mm")
    faults = [
        f"{name} = {value:g} (allowed {a:g} to {b:g})"
        for name, value, a, b in zip(names, points[worst], low, high, strict=True)
        if not a <= value <= b
    ]
    return (
        f"position {worst} of {len(points)} lies outside the slot's table: {', '.join(faults)}. "
        "Build the table with a larger grid, or ask for zero beyond it."
    )


def build_table(
    slot: Slot,
    coil: Coil,
    conductor: Conductor,
    frequency_hz: float,
    *,
    grid: TableGrid | None = None,
    progress: Progress = silent,
) -> SlotTable:
    """Compute a table; about two seconds for 41 x 41 x 12 nodes."""
    grid = grid or table_grid(slot, coil)
    detail = 0.5 * (coil.inner_radius_mm + coil.outer_radius_mm)
    solver = SlotSolver(slot, conductor, frequency_hz, detail_mm=detail)
    x, y = np.meshgrid(grid.x_mm, grid.y_mm, indexing="ij")
    flat_x, flat_y = x.ravel(), y.ravel()
    values = np.empty((x.size, len(grid.lift_off_mm)), dtype=np.complex128)
    reach = float(np.hypot(grid.x_mm[-1] + 0.5 * slot.length_mm, grid.y_mm[-1]))
    on_slot = solver.coil(coil, reach_mm=reach, lift_off_mm=np.asarray(grid.lift_off_mm))
    for part, drive in on_slot.drives(flat_x * MM, flat_y * MM):
        values[part] = solver.reaction_ohm(drive, drive)
        progress("slot table", part.stop, x.size)
    return SlotTable(grid, values.reshape(*x.shape, -1))


def default_cache() -> Path:
    """Return the folder for tables: $EDDYSCAN_CACHE, else the user's cache folder."""
    base = os.environ.get("EDDYSCAN_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "eddyscan"
    )
    return Path(base) / "slot-tables"


def slot_table(
    slot: Slot,
    coil: Coil,
    conductor: Conductor,
    frequency_hz: float,
    *,
    grid: TableGrid | None = None,
    cache: Path | None = None,
    progress: Progress = silent,
) -> SlotTable:
    """Return the table from the cache folder, or compute and keep it.

    The file's name is a hash of every input and of the model's version; a file
    that cannot be read is computed again. A folder that cannot be written is no
    fault: the table is then computed each time.
    """
    grid = grid or table_grid(slot, coil)
    inputs = {
        "model": MODEL,
        "slot": asdict(slot),
        "coil": asdict(coil),
        "conductor": asdict(conductor),
        "frequency_hz": float(frequency_hz),
        "grid": asdict(grid),
    }
    text = json.dumps(inputs, sort_keys=True)
    path = (cache or default_cache()) / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.npz"
    kept = _read(path, text)
    if kept is not None and kept.shape == (len(grid.x_mm), len(grid.y_mm), len(grid.lift_off_mm)):
        return SlotTable(grid, kept)
    table = build_table(slot, coil, conductor, frequency_hz, grid=grid, progress=progress)
    _keep(path, text, table.values)
    return table


def _read(path: Path, text: str) -> ComplexArray | None:
    try:
        with path.open("rb") as file, np.load(file) as stored:
            return np.asarray(stored["values"], np.complex128) if str(stored["inputs"]) == text else None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None


def _keep(path: Path, text: str, values: ComplexArray) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent) as folder:
            part = Path(folder) / path.name
            np.savez(part, values=values, inputs=np.array(text))
            os.replace(part, path)
    except OSError:
        return
