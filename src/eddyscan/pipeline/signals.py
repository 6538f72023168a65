"""What a coil reads: a signal case file to figures, tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eddyscan.core.errors import InputError


def signal(case_file: Path, *, sweep: str | None = None, plot: Path | None = None) -> dict[str, Any]:
    """Solve a signal case; with `sweep`, over frequency or lift-off; with `plot`, draw it."""
    from eddyscan.physics.case import read_case, solve_case

    case = read_case(case_file)
    if sweep is not None or plot is not None:
        raise InputError("sweeps and plots of a signal case are still to come.")
    return dict(solve_case(case))


def signal_table(result: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return column names and rows for people."""
    if "sweep" in result:
        columns = list(result["sweep"][0])
        return columns, [[f"{row[key]:.6g}" for key in columns] for row in result["sweep"]]
    rows = [
        [name, "", f"{result[name]['resistance_ohm']:.6g}", f"{1e6 * result[name]['inductance_h']:.6g}"]
        for name in ("air", "sound")
    ]
    rows += [
        [f"slot x {entry['x_mm']:g}", f"{entry['y_mm']:g}", f"{entry['dr_ohm']:.6g}", f"{1e6 * entry['dl_h']:.6g}"]
        for entry in result.get("slot", [])
    ]
    return ["state or x mm", "y mm", "resistance or change ohm", "inductance or change uH"], rows
