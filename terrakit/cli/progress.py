"""How far a run is: a live display on a terminal, a line for each finished step elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from terrakit.cli.messages import Settings, note

if TYPE_CHECKING:
    from terrakit.running import Progress


class Reporter:
    """Tells the user about steps; hand :meth:`update` to a run as ``on_progress``."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._live: Any = None
        self._task: Any = None
        self._shown = ""

    @contextmanager
    def showing(self) -> Iterator[Reporter]:
        """Show the display inside the block, where there is a terminal to show it on."""
        if self._settings.is_quiet or not _is_terminal():
            yield self
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        live = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        with live:
            self._live = live
            try:
                yield self
            finally:
                self._live = None

    def update(self, progress: Progress) -> None:
        """Show how far the current step is."""
        if self._live is None:
            return
        if progress.step != self._shown:
            self._start(progress.step)
        self._live.update(self._task, completed=progress.done, total=progress.total or None)

    def done(self, step: str, seconds: float, remark: str = "") -> None:
        """Say that a step is finished and how long it took."""
        if self._live is not None and self._task is not None:
            self._live.remove_task(self._task)
            self._task, self._shown = None, ""
        if not self._settings.is_quiet:
            note(f"{step}  {seconds:.1f} s{f'  ({remark})' if remark else ''}")

    def say(self, line: str) -> None:
        """Write a line, unless only errors are wanted."""
        if not self._settings.is_quiet:
            note(line)

    def _start(self, step: str) -> None:
        if self._task is not None:
            self._live.remove_task(self._task)
        self._task, self._shown = self._live.add_task(step, total=None), step


def _is_terminal() -> bool:
    return (
        sys.stderr is not None and sys.stderr.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    )
