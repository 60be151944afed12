"""Reading and writing terrain files for the commands that take them as arguments."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terrakit.operators import Operator, Surface
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


def named_files(operator: Operator) -> Callable[[Run], dict[str, Surface]]:
    """Check the files that stand where a recipe would name a step, and return what reads them.

    ``other.npz`` means the terrain in that file, ``other.npz.sediment`` a layer of it.
    """
    from terrakit.errors import ParameterError
    from terrakit.sources import references_within

    readers: dict[str, Callable[[Run], Surface]] = {}
    for reference in references_within(operator):
        whole, (stem, dot, _) = reference.text, reference.text.rpartition(".")
        if reference.role == "layer" and not dot:
            continue  # a layer of the terrain itself
        path = next((name for name in (whole, stem) if name and Path(name).is_file()), None)
        if path is not None:
            readers[path] = reader(path, {})
        elif reference.role != "layer":
            raise ParameterError(f"{operator.name}: {reference.path} = {whole!r}: no such file")

    def read(run: Run) -> dict[str, Surface]:
        return {path: read_one(run) for path, read_one in readers.items()}

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
