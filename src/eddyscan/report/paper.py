"""Sheets of A4 that fill from top to bottom."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eddyscan.report.theme import PAPER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Pixels = NDArray[np.uint8]
WIDTH_PT, HEIGHT_PT = 595.28, 841.89
MARGIN_PT, FOOT_PT = 48.0, 54.0
ROOM_PT = WIDTH_PT - 2 * MARGIN_PT


class Paper:
    """Writes downwards; `need` opens a new sheet when the rest of this one is too short."""

    def __init__(self, foot: str) -> None:
        self.foot = foot
        self.sheets: list[Figure] = []
        self.y_pt = 0.0
        self._new_sheet()

    def _new_sheet(self) -> None:
        from matplotlib.figure import Figure

        self.sheets.append(Figure(figsize=(WIDTH_PT / 72, HEIGHT_PT / 72), facecolor="white"))
        self.y_pt = HEIGHT_PT - MARGIN_PT

    def need(self, height_pt: float) -> bool:
        """Make sure `height_pt` fits below; return whether a new sheet was opened."""
        if self.y_pt - height_pt >= FOOT_PT:
            return False
        self._new_sheet()
        return True

    def skip(self, height_pt: float) -> None:
        """Leave some room."""
        self.y_pt -= height_pt

    def put(
        self,
        text: str,
        x_pt: float,
        size_pt: float,
        *,
        colour: str = PAPER.ink,
        bold: bool = False,
        align: str = "left",
        drop_pt: float = 0.0,
    ) -> None:
        """Write one line with its top at the cursor less `drop_pt`; does not move the cursor."""
        self.sheets[-1].text(
            (MARGIN_PT + x_pt) / WIDTH_PT,
            (self.y_pt - drop_pt) / HEIGHT_PT,
            text.replace("$", r"\$"),
            size=size_pt,
            color=colour,
            weight="bold" if bold else "normal",
            ha=align,
            va="top",
        )

    def rule(
        self, *, x_pt: float = 0.0, length_pt: float = ROOM_PT, colour: str = PAPER.rule, weight: float = 0.6
    ) -> None:
        """Draw a horizontal line at the cursor."""
        from matplotlib.lines import Line2D

        ends = [(MARGIN_PT + x_pt) / WIDTH_PT, (MARGIN_PT + x_pt + length_pt) / WIDTH_PT]
        height = [self.y_pt / HEIGHT_PT] * 2
        self.sheets[-1].add_artist(Line2D(ends, height, color=colour, lw=weight))

    def picture(self, pixels: Pixels, x_pt: float, width_pt: float) -> float:
        """Place a picture with its top at the cursor; return its height [pt]."""
        height = float(width_pt * pixels.shape[0] / pixels.shape[1])
        box = (
            (MARGIN_PT + x_pt) / WIDTH_PT,
            (self.y_pt - height) / HEIGHT_PT,
            width_pt / WIDTH_PT,
            height / HEIGHT_PT,
        )
        axes = self.sheets[-1].add_axes(box)
        axes.imshow(pixels, aspect="auto", interpolation="none")
        axes.set_axis_off()
        return height

    def number_sheets(self) -> None:
        """Write the foot line on every sheet."""
        for number, sheet in enumerate(self.sheets, start=1):
            line = f"{self.foot}  ·  page {number} of {len(self.sheets)}"
            sheet.text(0.5, 26 / HEIGHT_PT, line, size=7.5, color=PAPER.muted, ha="center", va="bottom")
