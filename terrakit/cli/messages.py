"""What the program says on stderr: errors, warnings and notes, a line each."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

LONGEST_LINE = 600


@dataclass
class Settings:
    """The options that every command has."""

    verbosity: int = 0
    debug: bool = False
    strict: bool = False

    @property
    def is_quiet(self) -> bool:
        """Whether only errors and warnings are wanted."""
        return self.verbosity < 0


def error(message: str) -> None:
    """Say why the program ends."""
    _say(f"terrakit: error: {one_line(message)}")


def warning(message: str) -> None:
    """Say what the user should know although the program goes on."""
    _say(f"terrakit: warning: {one_line(message)}")


def note(message: str) -> None:
    """Say how far the program is."""
    _say(message)


def one_line(message: str) -> str:
    """Return a message on one line, in characters that can be written, cut if it is very long."""
    text = " ".join(message.splitlines())
    text = text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return text if len(text) <= LONGEST_LINE else text[: LONGEST_LINE - 3] + "..."


def shown(path: Path | str) -> str:
    """Return a path as it can be written to a terminal."""
    text = os.fspath(path)
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


def install_warnings() -> None:
    """Show each warning once, as one line."""
    seen: set[str] = set()

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        del place, more
        text = str(message)
        if text not in seen:
            seen.add(text)
            warning(text)

    warnings.showwarning = show


def warnings_are_errors() -> None:
    """Raise warnings from here on, those that a user can do something about."""
    for category in (UserWarning, RuntimeWarning):
        warnings.simplefilter("error", category)


def close_output() -> None:
    """Point stdout at nothing, after its reader has gone away."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _say(line: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        click.echo(line, err=True)
