"""Settings models as commented TOML: each key with its description and limits."""

from __future__ import annotations

import json
import typing
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

BOUNDS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


def commented_toml(settings: BaseModel, heading: str = "") -> str:
    """Return the settings as TOML text; keys that are None stand commented out.

    Parameters
    ----------
    settings : BaseModel
        A model of tables (models) of plain values.
    heading : str
        Comment lines for the top of the file.
    """
    lines = [f"# {line}".rstrip() for line in heading.splitlines()]
    _write_table(settings, "", lines)
    return "\n".join(lines).strip() + "\n"


def limits_in_words(field: FieldInfo) -> str:
    """Return a field's limits and choices, for example "> 0, <= 10" or "step | row | pvt"."""
    choices = _literal_values(field.annotation)
    if choices:
        return " | ".join(choices)
    words = []
    for rule in field.metadata:
        for name, sign in BOUNDS.items():
            if (bound := getattr(rule, name, None)) is not None:
                words.append(f"{sign} {bound:g}")
    return ", ".join(words)


def _literal_values(annotation: Any) -> list[str]:
    if typing.get_origin(annotation) is typing.Literal:
        return [str(value) for value in typing.get_args(annotation)]
    return []


def _write_table(model: BaseModel, path: str, lines: list[str]) -> None:
    fields = type(model).model_fields
    tables = {name for name in fields if isinstance(getattr(model, name), BaseModel)}
    if path:
        lines.append("")
        doc = (type(model).__doc__ or "").strip().splitlines()
        if doc:
            lines.append(f"# {doc[0]}")
        lines.append(f"[{path}]")
    for name, field in fields.items():
        if name not in tables:
            lines.append(_key_line(name, getattr(model, name), field))
    for name in fields:
        if name in tables:
            _write_table(getattr(model, name), f"{path}.{name}" if path else name, lines)


def _key_line(name: str, value: Any, field: FieldInfo) -> str:
    comment = "; ".join(part for part in (field.description or "", limits_in_words(field)) if part)
    line = f"# {name} =" if value is None else f"{name} = {_toml_value(value)}"
    return f"{line:<34} # {comment}" if comment else line


def _toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(entry) for entry in value) + "]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False)
