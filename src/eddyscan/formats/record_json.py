"""Notes of a record as JSON text: numpy, pydantic and dataclass values included."""

from __future__ import annotations

import dataclasses
import json
from pathlib import PurePath
from typing import Any

import numpy as np
from pydantic import BaseModel


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {"re": value.real, "im": value.imag}
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError(f"a record note cannot hold a {type(value).__name__}; give numbers, texts, lists or dicts.")


def to_json(value: object, *, indent: int | None = None) -> str:
    """Return `value` as JSON; a complex number becomes ``{"re", "im"}``, an array nested lists."""
    return json.dumps(value, default=_plain, indent=indent, ensure_ascii=False)
