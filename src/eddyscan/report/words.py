"""Numbers and names as a person reads them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

UNITS = {
    "_mm_s": "mm/s",
    "_mm2": "mm²",
    "_mm": "mm",
    "_um": "µm",
    "_mohm": "mΩ",
    "_ohm": "Ω",
    "_deg": "°",
    "_khz": "kHz",
    "_hz": "Hz",
    "_ms_m": "MS/m",
    "_ms": "ms",
    "_db": "dB",
    "_s": "s",
    "_v": "V",
    "_px": "px",
    "_percent": "%",
}
MISSING = "–"


def number(value: float | None, digits: int = 4) -> str:
    """Return `value` with `digits` significant digits, without needless zeros or exponents."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return MISSING
    if value == 0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    if -6 < decimals < 9:
        text = f"{value:.{max(decimals, 0)}f}"
        return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", "−")
    return f"{value:.{digits - 1}e}"


def plus_minus(value: float | None, uncertainty: float | None, decimals: int = 2) -> str:
    """Return "1.20 ± 0.05", or a dash when there is no value."""
    if value is None:
        return MISSING
    return f"{value:.{decimals}f}" + (f" ± {uncertainty:.{decimals}f}" if uncertainty is not None else "")


def percent(share: float) -> str:
    """Return a share (0-1) as a percentage; never rounds up to 100."""
    return f"{math.floor(share * 1000) / 10:.1f} %"


def label(key: str) -> str:
    """Turn a name such as ``rms_lift_off_um`` into "rms lift-off [µm]"."""
    for suffix, unit in UNITS.items():
        if key.endswith(suffix) and key != suffix:
            return f"{spelled(key.removesuffix(suffix))} [{unit}]"
    return spelled(key)


WORDS = {
    "rmse": "root mean square",
    "rms": "root mean square",
    "mad": "in robust standard deviations",
    "p05": "5 % below",
    "p50": "median",
    "p95": "95 % below",
    "p99": "99 % below",
    "max": "largest",
    "min": "least",
    "std": "standard deviation",
    "sd": "standard deviation",
}


def spelled(name: str) -> str:
    """Turn an identifier into words."""
    whole = name.replace("mean_abs", "mean absolute").replace("lift_off", "lift-off")
    return " ".join(WORDS.get(word, word) for word in whole.split("_") if word)


def value_text(value: Any) -> str:
    """Return any plain value as text."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number(value)
    if isinstance(value, (list, tuple)):
        return ", ".join(value_text(entry) for entry in value) or MISSING
    return str(value)


def flattened(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Give (label, text) for every entry, nested tables with their parents' names in front."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flattened(value, f"{prefix}{label(str(key))} · ")
        elif isinstance(value, (list, tuple)) and value and all(isinstance(entry, Mapping) for entry in value):
            for index, entry in enumerate(value, start=1):
                yield from flattened(entry, f"{prefix}{label(str(key))} {index} · ")
        else:
            yield prefix + label(str(key)), value_text(value)
