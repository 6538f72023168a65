"""What a command says: progress bars and tables for people, one JSON object for programs."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from eddyscan.core.plain import plain

messages = Console(stderr=True, highlight=False)
SHOW_AFTER_S = 1.0
SAY_EVERY_S = 10.0


class ProgressBars:
    """Shows a bar with the time left for every piece of work that takes over a second.

    On a terminal these are live bars; elsewhere a line every ten seconds, so a
    log stays readable.
    """

    def __init__(self, console: Console = messages) -> None:
        self._console = console
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._began: dict[str, float] = {}
        self._said = time.monotonic()

    def __call__(self, what: str, done: float, total: float) -> None:
        """Report progress of `what`."""
        now = time.monotonic()
        began = self._began.setdefault(what, now)
        if now - began < SHOW_AFTER_S and what not in self._tasks:
            return
        if self._console.is_terminal:
            self._show(what, done, total)
        elif now - self._said > SAY_EVERY_S:
            self._said = now
            self._console.print(f"{what}: {done:.0f} of {total:.0f}")

    def _show(self, what: str, done: float, total: float) -> None:
        if self._bars is None:
            self._bars = Progress(
                TextColumn("{task.description:<28}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeElapsedColumn(),
                TextColumn("left"),
                TimeRemainingColumn(),
                console=self._console,
            )
            self._bars.start()
        if what not in self._tasks:
            self._tasks[what] = self._bars.add_task(what, total=total)
        self._bars.update(self._tasks[what], completed=done, total=total)

    def close(self) -> None:
        """End the live display."""
        if self._bars is not None:
            self._bars.stop()


@contextlib.contextmanager
def progress_bars() -> Iterator[ProgressBars]:
    """Yield a progress callable that cleans up after itself."""
    bars = ProgressBars()
    try:
        yield bars
    finally:
        bars.close()


def say(text: str) -> None:
    """Print a message for people on standard error."""
    messages.print(text, markup=False, soft_wrap=True)


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table for people on standard error."""
    view = Table(title=title, title_justify="left", title_style="bold", header_style="bold")
    for number, column in enumerate(columns):
        view.add_column(column, justify="left" if number == 0 else "right")
    for row in rows:
        view.add_row(*(str(cell) for cell in row))
    messages.print(view)


def emit_json(value: Mapping[str, Any]) -> None:
    """Print the command's one JSON object on standard output; NaN becomes null."""
    sys.stdout.write(json.dumps(plain(value), allow_nan=False, default=str) + "\n")
    sys.stdout.flush()
