"""Reading and writing terrain files for the commands that take them as arguments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrakit.operators import Surface
    from terrakit.running import Run


def reader(path: str, settings: dict[str, Any]) -> Callable[[Run], Surface]:
    """Check that a file can be read with these parameters, and return what reads it."""
    from terrakit.api import importer_of
    from terrakit.execute import execute

    source = Path(path)
    operator = importer_of(source).from_settings(settings, source.name)

    def read(run: Run) -> Surface:
        surface: Surface = execute(operator, source, run)
        return surface

    return read


def writer(
    path: str, settings: dict[str, Any], name: str | None = None
) -> Callable[[Surface, Run], list[Path]]:
    """Check that a file can be written with these parameters, and return what writes it."""
    from terrakit import atomic
    from terrakit.api import exporter_for
    from terrakit.execute import execute
    from terrakit.registry import default_registry

    target = Path(path)
    name = name or exporter_for(target)
    operator = default_registry().get(name, "exporter").from_settings(settings, name)
    atomic.writable_target(target)

    def write(surface: Surface, run: Run) -> list[Path]:
        written: list[Path] = execute(operator, (surface, target), run)
        return written

    return write
