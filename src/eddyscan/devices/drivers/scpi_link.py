"""A VISA session whose failures come out as LinkError with the address and the way out."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

from eddyscan.core.errors import EddyscanError, LinkError


class VisaLink:
    """One open session; `adapter` is what a PyMeasure instrument takes."""

    def __init__(self, adapter: Any, address: str) -> None:
        self.adapter, self.address = adapter, address
        self._open = True

    def ask(self, command: str) -> str:
        """Send a query and return its answer without line end."""
        self.adapter.write(command)
        return str(self.adapter.read()).strip()

    def set_timeout(self, seconds: float) -> None:
        """Set how long an answer may take [s, wall time]."""
        self.adapter.connection.timeout = 1000 * seconds

    def close(self) -> None:
        """Close the session; again: nothing."""
        if self._open:
            self._open = False
            with contextlib.suppress(Exception):
                self.adapter.close()

    @contextlib.contextmanager
    def guarded(self, doing: str) -> Iterator[None]:
        """Turn every failure of the transport into a LinkError."""
        try:
            yield
        except EddyscanError:
            raise
        except Exception as fault:
            raise LinkError(
                f"the instrument at {self.address} failed to {doing}: {_in_words(fault)}. "
                "Check the cable, the power and the address in rig.toml, then run again; what was recorded is kept."
            ) from fault


def open_visa_session(address: str, timeout_s: float) -> VisaLink:
    """Open a VISA resource through pyvisa-py.

    Raises
    ------
    LinkError
        When nobody answers at the address.
    """
    import pyvisa
    from pymeasure.adapters import VISAAdapter

    options: dict[str, Any] = {"timeout": 1000 * timeout_s, "open_timeout": int(1000 * timeout_s)}
    if address.upper().endswith("SOCKET") or address.upper().startswith("ASRL"):
        options |= {"read_termination": "\n", "write_termination": "\n"}
    try:
        return VisaLink(VISAAdapter(address, visa_library="@py", **options), address)
    except (pyvisa.errors.Error, OSError, ValueError) as fault:
        raise LinkError(
            f"no instrument answers at {address}: {_in_words(fault)}. "
            "Check [instrument] address in rig.toml, the cable and the power."
        ) from fault


def parsed_values(answer: str, count: int, address: str) -> list[float]:
    """Return the first `count` numbers of a comma-separated answer.

    Raises
    ------
    LinkError
        When there are fewer, or one is not a finite number.
    """
    words = answer.split(",")
    try:
        values = [float(word) for word in words[:count]]
    except ValueError:
        values = []
    if len(values) < count or not all(math.isfinite(value) for value in values):
        raise LinkError(
            f"the instrument at {address} answered {answer!r} where {count} numbers were due. "
            "The line is garbled, or another program talks to the instrument."
        )
    return values


def _in_words(fault: BaseException) -> str:
    text = " ".join(str(fault).split())
    return text or type(fault).__name__
