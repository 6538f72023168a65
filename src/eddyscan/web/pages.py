"""The page's own HTML: the shell that the scripts fill, the password form, the closed door."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

STATIC = Path(__file__).parent / "static"


def main_page(given: Mapping[str, Any]) -> str:
    """Return the page; `given` is what its scripts start from."""
    return _rendered("page.html.j2", given=_harmless(given))


def login_page() -> str:
    """Return the page that asks for the password."""
    return _rendered("door.html.j2", title="eddyscan", message="", password=True)


def refused_page(message: str) -> str:
    """Return the page of a closed door."""
    return _rendered("door.html.j2", title="eddyscan", message=message, password=False)


def _harmless(given: Mapping[str, Any]) -> str:
    text = json.dumps(dict(given))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _rendered(name: str, **values: Any) -> str:
    return str(_templates().get_template(name).render(**values))


@lru_cache(maxsize=1)
def _templates() -> Any:
    from jinja2 import Environment, FileSystemLoader

    return Environment(loader=FileSystemLoader(STATIC), autoescape=True)
