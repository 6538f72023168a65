"""How long work tells how far it is: a plain callable, so rooms need no terminal."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called with the work's name, what is done and what there is in all."""

    def __call__(self, what: str, done: float, total: float) -> None:
        """Report progress; must return quickly and never raise."""


def silent(what: str, done: float, total: float) -> None:
    """Report to nobody."""
