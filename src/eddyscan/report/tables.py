"""Tables from plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from eddyscan.core.technique import Section as Settings
from eddyscan.report.blocks import Block, Facts, Table
from eddyscan.report.words import flattened, label, spelled, value_text


def facts_of(values: Mapping[str, Any], title: str = "", *, wide: bool = False) -> Facts:
    """Return nested plain values as names and texts."""
    return Facts(tuple(flattened(values)), title, wide)


def settings_facts(settings: Settings, title: str) -> Facts:
    """Return one table of the technique as names and texts."""
    return facts_of(settings.model_dump(), title)


def table_of(entries: Sequence[Mapping[str, Any]], title: str = "") -> Table:
    """Return dicts as a table with one column per key, in the order first seen."""
    keys = list(dict.fromkeys(key for entry in entries for key in entry))
    rows = tuple(tuple(value_text(entry.get(key)) for key in keys) for entry in entries)
    texts = {k for k, key in enumerate(keys) if any(isinstance(entry.get(key), str) for entry in entries)}
    return Table(tuple(label(key) for key in keys), rows, title, frozenset(texts))


def blocks_of(values: Mapping[str, Any]) -> list[Block]:
    """Return nested plain values as facts, with a table for every list of dicts in them."""
    flat, tables = _parted(values, "")
    return [*([facts_of(flat, wide=True)] if flat else []), *tables]


def _parted(values: Mapping[str, Any], above: str) -> tuple[dict[str, Any], list[Block]]:
    flat: dict[str, Any] = {}
    tables: list[Block] = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            below, more = _parted(value, f"{above}{spelled(str(key))} · ")
            tables += more
            if below:
                flat[key] = below
        elif isinstance(value, (list, tuple)) and value and all(isinstance(entry, Mapping) for entry in value):
            tables.append(table_of(value, f"{above}{spelled(str(key))}".capitalize()))
        else:
            flat[key] = value
    return flat, tables


def as_entries(value: Any) -> list[dict[str, Any]]:
    """Return a list of dicts from what a record's note may hold: a list, a dict of dicts, or one dict."""
    if isinstance(value, Mapping):
        if value and all(isinstance(entry, Mapping) for entry in value.values()):
            return [{"name": str(name), **entry} for name, entry in value.items()]
        return [dict(value)] if value else []
    if isinstance(value, (list, tuple)):
        return [dict(entry) if isinstance(entry, Mapping) else {"entry": entry} for entry in value]
    return [] if value is None else [{"entry": value}]
