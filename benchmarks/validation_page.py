"""Keeps docs/validation.md: every benchmark owns one section and replaces only that."""

from __future__ import annotations

from pathlib import Path

PAGE = Path(__file__).resolve().parent.parent / "docs" / "validation.md"
PICTURES = PAGE.parent / "pictures"
HEAD = "# Validation\n\nEvery number below is printed by the command above its table.\n"


def write_section(name: str, title: str, body: str) -> None:
    """Replace (or append) the section called `name` with a title and a Markdown body."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else HEAD
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    section = f"{begin}\n## {title}\n\n{body.strip()}\n{end}\n"
    if begin in text:
        text = text[: text.index(begin)] + section + text[text.index(end) + len(end) + 1 :]
    else:
        text = text.rstrip() + "\n\n" + section
    PAGE.write_text(text, encoding="utf-8")
