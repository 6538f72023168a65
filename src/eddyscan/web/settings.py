"""technique.toml as a form: every value with its unit, limits and meaning, checked by the model itself."""

from __future__ import annotations

import re
import typing
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from eddyscan.core.commented_toml import commented_toml, limits_in_words
from eddyscan.core.errors import InputError, TechniqueError
from eddyscan.core.technique import Technique
from eddyscan.inspection import Inspection

HEADING = """The written procedure of this inspection. Lengths in mm, angles in deg.
A key you do not need can go: its default holds. An unknown key is an error."""
UNITS = {
    "mm_s": "mm/s",
    "ms_m": "MS/m",
    "mm": "mm",
    "deg": "deg",
    "hz": "Hz",
    "s": "s",
    "v": "V",
    "mm2": "mm²",
    "ohm": "Ω",
    "px": "px",
    "mad": "× robust SD",
}


def form(technique: Technique) -> list[dict[str, Any]]:
    """Return the sections of the form with their fields."""
    return [
        {"section": name, "about": _first_line(type(section)), "fields": _fields(section)}
        for name, section in _sections(technique)
    ]


def faults(technique: Technique, changes: Any) -> dict[str, str]:
    """Return "section.key" -> what is wrong when `changes` are made; empty when the technique holds."""
    try:
        Technique.model_validate(changed(technique, changes))
    except ValidationError as error:
        return {".".join(str(p) for p in fault["loc"][:2]): _words(dict(fault)) for fault in error.errors()}
    return {}


def save(inspection: Inspection, changes: Any, who: str) -> dict[str, Any]:
    """Write technique.toml and log what changed; raises TechniqueError when a value does not hold."""
    old = inspection.technique()
    wrong = faults(old, changes)
    if wrong:
        listed = "; ".join(f"{key}: {fault}" for key, fault in wrong.items())
        raise TechniqueError(f"the technique was not saved: {listed}.")
    new = Technique.model_validate(changed(old, changes))
    different = _differences(old, new)
    if different:
        temporary = inspection.technique_file.with_name(".technique.toml.new")
        temporary.write_text(commented_toml(new, HEADING), encoding="utf-8")
        temporary.replace(inspection.technique_file)
        inspection.log("technique", changed=different, by=who)
    return {"changed": different}


def changed(technique: Technique, changes: Any) -> dict[str, Any]:
    """Return the technique's tables with {section: {key: value}} put in; nothing is checked yet."""
    data = technique.model_dump(mode="json")
    if not isinstance(changes, Mapping) or not all(isinstance(table, Mapping) for table in changes.values()):
        raise InputError("a change of the technique is an object of tables; nothing was saved. Reload the page.")
    for section, table in changes.items():
        data[section] = {**data.get(section, {}), **table}
    return data


def _sections(technique: Technique) -> list[tuple[str, BaseModel]]:
    named = [(name, getattr(technique, name)) for name in type(technique).model_fields]
    return [(name, section) for name, section in named if isinstance(section, BaseModel)]


def _fields(section: BaseModel) -> list[dict[str, Any]]:
    fields = type(section).model_fields.items()
    values = section.model_dump(mode="json")
    return [_field(name, values[name], field) for name, field in fields if not _is_table(field)]


def _field(name: str, value: Any, field: FieldInfo) -> dict[str, Any]:
    choices = typing.get_args(field.annotation) if typing.get_origin(field.annotation) is typing.Literal else ()
    kind = "choice" if choices else _kind(field.annotation)
    return {
        "key": name,
        "value": value,
        "unit": unit_of(name),
        "kind": kind,
        "choices": list(choices),
        "limits": "" if choices else limits_in_words(field),
        "about": (field.description or "").split(";")[0],
    }


def unit_of(name: str) -> str:
    """Return the unit that a key's last words name."""
    for ending in sorted(UNITS, key=len, reverse=True):
        if name == ending or name.endswith(f"_{ending}"):
            return UNITS[ending]
    return ""


def _kind(annotation: Any) -> str:
    if annotation is bool:
        return "switch"
    if annotation in (int, float):
        return "number"
    return "text" if annotation in (str, str | None) else "other"


def _is_table(field: FieldInfo) -> bool:
    kinds = (field.annotation, *typing.get_args(field.annotation))
    return any(isinstance(kind, type) and issubclass(kind, BaseModel) for kind in kinds)


def _first_line(model: type[BaseModel]) -> str:
    return (model.__doc__ or "").strip().splitlines()[0] if model.__doc__ else ""


def _words(fault: dict[str, Any]) -> str:
    if fault["type"] == "extra_forbidden":
        return "unknown key"
    said = re.sub(r"^(Value error, |Input )", "", fault["msg"])
    return said[:1].lower() + said[1:]


def _differences(old: Technique, new: Technique) -> dict[str, list[Any]]:
    before, after = old.model_dump(mode="json"), new.model_dump(mode="json")
    return {
        f"{section}.{key}": [before[section].get(key), value]
        for section, table in after.items()
        for key, value in table.items()
        if before[section].get(key) != value
    }
