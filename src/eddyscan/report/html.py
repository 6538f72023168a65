"""The report as one HTML file that opens anywhere, without a network."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

from eddyscan.report.blocks import Block, Section
from eddyscan.report.content import ReportContent
from eddyscan.report.headline import headline
from eddyscan.report.sections import sections
from eddyscan.report.theme import to_svg


def render_html(content: ReportContent) -> str:
    """Return the whole report as one self-contained HTML document.

    Style, script, pictures and the 3-D viewer are inside; nothing is fetched.
    A part of the inspection that `content` does not hold is named as missing
    in its section.
    """
    chapters = sections(content)
    return str(
        _environment()
        .get_template("report.html.j2")
        .render(
            content=content,
            headline=headline(content),
            sections=chapters,
            style=_packaged("report.css"),
            script=_packaged("report.js"),
            viewer=_viewer() if _has_scene(chapters) else "",
        )
    )


def _has_scene(chapters: Sequence[Section]) -> bool:
    return any(_kind(block) == "scene" for chapter in chapters for block in chapter.blocks)


def _kind(block: Block) -> str:
    return type(block).__name__.lower()


def _png(data: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(data).decode()


def _packaged(name: str) -> str:
    return files("eddyscan.report").joinpath(name).read_text(encoding="utf-8")


def _viewer() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("eddyscan.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "kind": _kind,
        "png": _png,
        "svg": lambda chart: Markup(to_svg(chart.draw, chart.caption)),
        "json_safe": lambda text: Markup(text.replace("</", "<\\/")),
        "inline": Markup,
    }
    return environment
