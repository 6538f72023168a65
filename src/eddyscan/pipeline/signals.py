"""What a coil reads: a signal case file to figures, tables and pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from eddyscan.core.errors import InputError
from eddyscan.core.progress import Progress, silent

PICTURES = (".png", ".svg", ".pdf")


def signal(
    case_file: Path, *, sweep: str | None = None, plot: Path | None = None, progress: Progress = silent
) -> dict[str, Any]:
    """Solve a signal case; with `sweep`, over frequency or lift-off; with `plot`, draw it.

    Raises InputError when `plot` has an ending that cannot be drawn.
    """
    from eddyscan.physics.case import read_case, solve_case
    from eddyscan.physics.plots import case_figure, sweep_figure
    from eddyscan.physics.sweep import sweep_case

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise InputError(f"--plot {plot}: a picture ends with {', '.join(PICTURES)}.")
    case = read_case(case_file)
    result = dict(solve_case(case) if sweep is None else sweep_case(case, sweep, progress=progress))
    if plot is not None:
        figure = case_figure(case) if sweep is None else sweep_figure(result)
        figure.savefig(plot, dpi=150)
    return result


def signal_table(result: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    """Return column names and rows for people."""
    if "sweep" in result:
        columns = list(result["sweep"][0])
        return columns, [[f"{row[key]:.4g}" for key in columns] for row in result["sweep"]]
    rows = [
        [name, "", f"{result[name]['resistance_ohm']:.6g}", f"{1e6 * result[name]['inductance_h']:.6g}"]
        for name in ("air", "sound")
    ]
    rows += [
        [f"slot x {entry['x_mm']:g}", f"{entry['y_mm']:g}", f"{entry['dr_ohm']:.6g}", f"{1e6 * entry['dl_h']:.6g}"]
        for entry in result.get("slot", [])
    ]
    return ["state or x mm", "y mm", "resistance or change ohm", "inductance or change uH"], rows
