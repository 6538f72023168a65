"""How wide a text is on paper, and where its lines break."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

HINTING = 1.03  # letters are set on whole pixels or glyph grids, so lines come out a little wider


@lru_cache(maxsize=8)
def _font(bold: bool) -> Any:
    from matplotlib.font_manager import FontProperties

    return FontProperties(family="sans-serif", weight="bold" if bold else "normal", size=10)


@lru_cache(maxsize=8192)
def width_pt(text: str, size_pt: float, *, bold: bool = False) -> float:
    """Return the width of one line of text [pt]."""
    from matplotlib.textpath import text_to_path

    if not text:
        return 0.0
    width, _, _ = text_to_path.get_text_width_height_descent(text, _font(bold), ismath=False)
    return float(width) * size_pt / 10.0 * HINTING


def wrapped(text: str, room_pt: float, size_pt: float, *, bold: bool = False) -> list[str]:
    """Break a text into lines that fit `room_pt`; a word too long for a line is cut."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if width_pt(longer, size_pt, bold=bold) <= room_pt:
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if lines[-1] and width_pt(lines[-1] + letter, size_pt, bold=bold) > room_pt:
                lines.append("")
            lines[-1] += letter
    return lines


def column_widths(columns: Sequence[str], rows: Sequence[Sequence[str]], room_pt: float, size_pt: float) -> list[float]:
    """Share `room_pt` among columns by what they hold; short columns get all they want."""
    wanted = [max(width_pt(cell, size_pt) for cell in column) + 8 for column in zip(columns, *rows, strict=True)]
    if sum(wanted) <= room_pt:
        spare = (room_pt - sum(wanted)) / len(wanted)
        return [width + spare for width in wanted]
    fair = room_pt / len(wanted)
    short = [width <= fair for width in wanted]
    left = room_pt - sum(width for width, is_short in zip(wanted, short, strict=True) if is_short)
    long = sum(width for width, is_short in zip(wanted, short, strict=True) if not is_short)
    return [width if is_short else left * width / long for width, is_short in zip(wanted, short, strict=True)]
