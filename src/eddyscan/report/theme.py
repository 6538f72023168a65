"""One look for every drawing: on the page it follows the reader's light or dark choice, on paper it is ink."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from eddyscan.core.frames import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Theme:
    """Colours by role."""

    ink: str
    muted: str
    rule: str
    accent: str
    second: str
    alarm: str
    paper: str


# Matplotlib knows no style-sheet variables: these stand-ins are exchanged for them in the finished SVG.
PAGE = Theme("#00000a", "#00000b", "#00000c", "#00000d", "#00000e", "#00000f", "#00001a")
PAPER = Theme("#16202a", "#5b6875", "#d5dbe0", "#0b6e75", "#c8562a", "#b3261e", "#ffffff")
VARIABLES = {
    PAGE.ink: "var(--ink)",
    PAGE.muted: "var(--muted)",
    PAGE.rule: "var(--rule)",
    PAGE.accent: "var(--accent)",
    PAGE.second: "var(--second)",
    PAGE.alarm: "var(--alarm)",
    PAGE.paper: "var(--paper)",
}


def settings(theme: Theme) -> dict[str, Any]:
    """Return matplotlib's settings for this theme."""
    return {
        "font.size": 9,
        "axes.titlesize": 9.5,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.titlecolor": theme.ink,
        "axes.labelsize": 9,
        "axes.labelcolor": theme.muted,
        "axes.edgecolor": theme.rule,
        "axes.facecolor": "none",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": theme.rule,
        "grid.linewidth": 0.6,
        "xtick.color": theme.rule,
        "ytick.color": theme.rule,
        "xtick.labelcolor": theme.muted,
        "ytick.labelcolor": theme.muted,
        "text.color": theme.ink,
        "legend.frameon": False,
        "legend.labelcolor": theme.muted,
        "legend.fontsize": 8.5,
        "figure.facecolor": "none",
        "savefig.facecolor": "none",
        "svg.fonttype": "none",
        "svg.hashsalt": "eddyscan",
        "pdf.fonttype": 42,
        "image.cmap": "viridis",
        "figure.dpi": 110,
        "savefig.dpi": 120,
    }


def canvas(
    *, height_in: float = 3.2, width_in: float = 9.0, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes, (rows, columns) of them squeezed to what there is."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def drawn(draw: Callable[[Theme], Figure], theme: Theme) -> Figure:
    """Run a drawing under the settings of `theme`."""
    from matplotlib import rc_context

    with rc_context(settings(theme)):
        return draw(theme)


def colour_bar(figure: Figure, drawn: Any, axes: Axes, theme: Theme, *, title: str = "") -> None:
    """Put a slim scale beside `axes`."""
    bar = figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=28, pad=0.015)
    bar.outline.set_visible(False)
    bar.ax.tick_params(size=0, labelcolor=theme.muted, labelsize=8.5)
    bar.set_label(title, color=theme.muted)


def map_height_in(points_mm: Array, width_in: float, *, extra_in: float = 0.75) -> float:
    """Return the height at which a plan view fills `width_in` without empty sides.

    points_mm : (N, >= 2) what the map shows; its bounding box sets the proportion.
    """
    size = np.ptp(points_mm[:, :2], axis=0)
    across = width_in - 1.35  # axis labels and colour scale
    return float(np.clip(across * size[1] / max(size[0], 1e-9) + extra_in, 1.6, 6.0))


def map_axes(axes: Axes, title: str) -> None:
    """Make `axes` a plan view of the part in true proportion."""
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")
    axes.grid(visible=False)


def to_svg(draw: Callable[[Theme], Figure], described: str = "") -> str:
    """Return the drawing as an SVG element whose colours follow the page; `described` is read out by screen readers."""
    from matplotlib import rc_context

    text = io.StringIO()
    with rc_context(settings(PAGE)):
        draw(PAGE).savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    label = described.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    svg = f'<svg role="img" aria-label="{label}"' + svg[svg.index("<svg") + 4 :]
    for stand_in, variable in VARIABLES.items():
        svg = svg.replace(stand_in, variable)
    return svg
