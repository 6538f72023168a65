"""What a section is built from, the same for the page and for paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eddyscan.report.theme import Theme


@dataclass(frozen=True)
class Facts:
    """Names and values, read line by line; `wide` ones stand alone in two columns."""

    rows: tuple[tuple[str, str], ...]
    title: str = ""
    wide: bool = False


@dataclass(frozen=True)
class Table:
    """A table; columns whose head ends with a unit in brackets hold numbers."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""
    text_columns: frozenset[int] = frozenset({0})


@dataclass(frozen=True)
class Chart:
    """A drawing: `draw(theme)` gives a fresh matplotlib figure."""

    draw: Callable[[Theme], Figure]
    caption: str
    half: bool = False


@dataclass(frozen=True)
class Picture:
    """A PNG with its caption."""

    png: bytes
    caption: str
    alt: str


@dataclass(frozen=True)
class Gallery:
    """Pictures side by side."""

    pictures: tuple[Picture, ...]
    caption: str = ""


@dataclass(frozen=True)
class Note:
    """A sentence that must be seen."""

    text: str
    kind: Literal["missing", "warning", "good", "plain"] = "plain"


@dataclass(frozen=True)
class Scene:
    """The interactive 3-D view, as plotly's JSON; on paper `still` stands for it."""

    figure_json: str
    caption: str
    still: Chart


@dataclass(frozen=True)
class Signatures:
    """Lines to sign on: role and name."""

    people: tuple[tuple[str, str], ...]


Block = Facts | Table | Chart | Gallery | Note | Scene | Signatures


@dataclass(frozen=True)
class Section:
    """A chapter of the report."""

    key: str
    title: str
    lead: str = ""
    blocks: tuple[Block, ...] = field(default_factory=tuple)
