"""Writes docs/reference/settings.md and commands.md from the models and the commands themselves.

python tools/reference_pages.py docs/reference
"""

from __future__ import annotations

import sys
from pathlib import Path

import typer
from pydantic import BaseModel

from eddyscan.cli.app import app
from eddyscan.core.commented_toml import limits_in_words
from eddyscan.core.technique import Technique
from eddyscan.devices.rig import RigSettings


def table_lines(model: type[BaseModel], path: str) -> list[str]:
    """Return the Markdown of one TOML table and the tables inside it."""
    fields = model.model_fields
    inner = {name: kind for name, field in fields.items() if (kind := model_in(field.annotation)) is not None}
    doc = (model.__doc__ or "").strip().splitlines()
    lines = [f"### `[{path}]`", "", *doc[:1], ""] if path else []
    plain = [name for name in fields if name not in inner]
    if plain:
        lines += ["| key | default | limits | meaning |", "|---|---|---|---|"]
        for name in plain:
            field = fields[name]
            default = "needed" if field.is_required() else f"`{field.default!r}`"
            limits = limits_in_words(field).replace("|", "\\|")
            lines.append(f"| `{name}` | {default} | {limits} | {field.description or ''} |")
        lines.append("")
    for name, kind in inner.items():
        lines += table_lines(kind, f"{path}.{name}" if path else name)
    return lines


def model_in(annotation: object) -> type[BaseModel] | None:
    """Return the model a field holds, also when it may be None."""
    options = [annotation, *getattr(annotation, "__args__", ())]
    return next((kind for kind in options if isinstance(kind, type) and issubclass(kind, BaseModel)), None)


def settings_page() -> str:
    """Return the page of every settings key."""
    lines = ["# Settings", "", "Made from the models; an unknown key is an error."]
    for title, model in (("technique.toml", Technique), ("rig.toml", RigSettings)):
        lines += ["", f"## {title}", "", *table_lines(model, "")]
    return "\n".join(lines) + "\n"


def commands_page() -> str:
    """Return the page of every command with its options."""
    group = typer.main.get_command(app)
    lines = ["# Commands", ""]
    for name, command in sorted(group.commands.items()):  # type: ignore[attr-defined]
        lines += [f"## eddyscan {name}", "", command.help or "", ""]
        rows = []
        for parameter in command.params:
            words = getattr(parameter, "help", None) or ""
            label = (
                ", ".join(parameter.opts) if parameter.param_type_name == "option" else (parameter.name or "").upper()
            )
            rows.append(f"| `{label}` | {words.replace('|', chr(92) + '|')} |")
        lines += ["| option | meaning |", "|---|---|", *rows, ""]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write both pages into the folder given on the command line."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "settings.md").write_text(settings_page(), encoding="utf-8")
    (folder / "commands.md").write_text(commands_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
