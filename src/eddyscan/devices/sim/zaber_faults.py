"""Faults on demand for the simulated controller: each acts once, after a number of commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

FaultKind = Literal["drop-link", "delay", "garble", "silence", "stall", "driver-off", "power-cycle"]


@dataclass(frozen=True)
class Fault:
    """What goes wrong.

    Attributes
    ----------
    kind : what happens
    after : commands answered properly before it happens
    count : how many answers it spoils (delay, garble, silence)
    axis : axis name for stall and driver-off
    at : stage reading [mm or deg] where a stall catches the axis; None: where it is
    delay_s : how late a delayed answer is [s of the clock]
    """

    kind: FaultKind
    after: int = 0
    count: int = 1
    axis: str = "x"
    at: float | None = None
    delay_s: float = 0.2


class FaultPlan:
    """Faults waiting for their command."""

    def __init__(self) -> None:
        self._waiting: list[list[object]] = []
        self._spoilers: list[list[object]] = []

    def add(self, fault: Fault) -> None:
        """Arm one more fault."""
        self._waiting.append([fault, fault.after])

    def clear(self) -> None:
        """Disarm everything."""
        self._waiting, self._spoilers = [], []

    def due(self) -> list[Fault]:
        """Count one command; return the faults that happen now, spoilers once per answer."""
        now: list[Fault] = []
        for entry in list(self._waiting):
            fault, left = entry
            assert isinstance(fault, Fault)
            assert isinstance(left, int)
            if left > 0:
                entry[1] = left - 1
                continue
            self._waiting.remove(entry)
            if fault.kind in ("delay", "garble", "silence"):
                self._spoilers.append([fault, fault.count])
            else:
                now.append(fault)
        for entry in list(self._spoilers):
            fault, left = entry
            assert isinstance(fault, Fault)
            assert isinstance(left, int)
            now.append(fault)
            entry[1] = left - 1
            if left <= 1:
                self._spoilers.remove(entry)
        return now


def garbled(line: bytes) -> bytes:
    """Return an answer as a disturbed line would deliver it: bits flipped, the end mark kept."""
    body = line.rstrip(b"\r\n")
    middle = len(body) // 2
    return body[:middle] + bytes(b ^ 0x2A for b in body[middle:]) + b"\r\n"
