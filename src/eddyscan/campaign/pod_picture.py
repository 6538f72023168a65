"""The POD curve as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from eddyscan.analysis.pod import PodCurve
from eddyscan.core.frames import Array, BoolArray

COLOURS = ("#0f766e", "#b45309")


def draw_pod(size_mm: Array, found: BoolArray, curves: Sequence[PodCurve], out: Path) -> None:
    """Draw hits, misses and curves with a90 and a90/95 into `out` (PNG)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axis = figure.subplots()
    axis.plot(size_mm, found.astype(float), "|", color="#64748b", markersize=7, alpha=0.5, label="found or missed")
    sizes = np.geomspace(size_mm.min(), size_mm.max(), 300)
    for curve, colour in zip(curves, COLOURS, strict=False):
        label = f"{curve.method}: a90 {curve.a90_mm:.2f}, a90/95 {curve.a90_95_mm:.2f} mm"
        axis.plot(sizes, curve.at(sizes), color=colour, label=label)
        axis.axvline(curve.a90_95_mm, color=colour, lw=0.8, ls=":")
    axis.axhline(0.9, color="#94a3b8", lw=0.8)
    axis.set(xlabel="flaw length [mm]", ylabel="probability of detection", title="POD (simulation)", ylim=(-0.03, 1.03))
    axis.legend(fontsize=8, loc="lower right")
    figure.savefig(out, dpi=120)
