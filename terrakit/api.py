"""The recipe's words as functions, for pipelines and notebooks.

Every function takes the same names and parameters as a recipe, works in any thread or spawned
process, and keeps no state between calls.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from terrakit.errors import InputError, ParameterError
from terrakit.execute import execute, surface_of
from terrakit.heightfield import Grid, Heightfield
from terrakit.mesh import TriMesh
from terrakit.operators import Importer, Surface
from terrakit.parameters import is_step_name
from terrakit.registry import default_registry
from terrakit.running import Progress, Run

if TYPE_CHECKING:
    from terrakit.analysis import Analysis
    from terrakit.compute import DeviceInfo
    from terrakit.parameters import Seed
    from terrakit.pipeline import Result

HEAD_BYTES = 4096

AnySurface = TypeVar("AnySurface", Heightfield, TriMesh)


def run(
    recipe: str | os.PathLike[str] | Mapping[str, Any],
    out: str | os.PathLike[str] | None = None,
    *,
    seed: Seed | None = None,
    device: DeviceInfo | str | None = None,
    settings: Mapping[str, Any] | None = None,
    cache: bool = True,
    on_progress: Callable[[Progress], None] | None = None,
) -> Result:
    """Run a recipe and return its terrain, files and record.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, path of a ``.toml`` file, or a mapping of the same structure.
    out
        Folder for the files; without it the exporting steps are left out.
    seed
        In place of the recipe's.
    device
        Name of a device, ``gpu``, ``cpu`` or ``numpy``; the best one without it.
    settings
        Changes, as ``--set`` takes them: ``{"stream_power.duration": 1e6, "samples": 513}``.
    cache
        Whether results of earlier runs may be used and kept.
    on_progress
        Called with a :class:`~terrakit.running.Progress` as steps get further.
    """
    from terrakit.pipeline import run_recipe
    from terrakit.recipe import load_recipe
    from terrakit.results import ResultCache

    loaded = load_recipe(recipe, settings)
    if seed is not None:
        loaded = loaded.with_seed(seed)
    return run_recipe(
        loaded,
        Run(loaded.header.seed, device, on_progress),
        None if out is None else Path(out),
        cache=ResultCache() if cache else None,
    )


def generate(
    name: str,
    shape: tuple[int, int] | int = 513,
    spacing: float = 10.0,
    *,
    origin: tuple[float, float] | None = None,
    run: Run | None = None,
    **settings: Any,
) -> Heightfield:
    """Return a new terrain: ``generate("fbm", 513, 20.0, wavelength=4000.0)``.

    Parameters
    ----------
    name
        A generator.
    shape
        Rows and columns, or one number for both.
    spacing
        Distance between samples, metres.
    origin
        World x, y of the north-west sample, metres.
    run
        Seed, device, progress; by default seed 0 on the best device.
    settings
        The generator's parameters. What takes a terrain takes a Heightfield here too.
    """
    shape = (shape, shape) if isinstance(shape, int) else shape
    result: Heightfield = _made(name, "generator", settings, Grid(shape, spacing, origin), run)
    return result


def apply(surface: AnySurface, name: str, *, run: Run | None = None, **settings: Any) -> AnySurface:
    """Return the surface after a filter: ``apply(terrain, "terrace", height=50.0)``.

    What takes a terrain takes a Heightfield here too, an operator, or what a recipe would say:
    ``apply(terrain, "blend", other=generate("fbm", 513))``.
    """
    result: AnySurface = _made(name, "filter", settings, surface_of(surface), run)
    return result


def erode(surface: AnySurface, name: str, *, run: Run | None = None, **settings: Any) -> AnySurface:
    """Return the surface after an erosion: ``erode(terrain, "thermal", talus_angle=33.0)``."""
    result: AnySurface = _made(name, "erosion", settings, surface_of(surface), run)
    return result


def texture(
    surface: AnySurface, name: str, *, run: Run | None = None, **settings: Any
) -> AnySurface:
    """Return the surface with a texture's layers: ``texture(terrain, "slope_height")``."""
    result: AnySurface = _made(name, "texture", settings, surface_of(surface), run)
    return result


def load(path: str | os.PathLike[str], *, run: Run | None = None, **settings: Any) -> Surface:
    """Return the terrain in a file; its content decides which importer reads it.

    Parameters
    ----------
    path
        The file.
    run
        Progress and cancel.
    settings
        The importer's parameters, such as ``spacing``.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged or of no known format.
    """
    source = Path(path)
    kind = importer_of(source)
    result: Surface = execute(kind.from_settings(settings, source.name), source, run or Run())
    return result


def export(
    surface: Surface,
    path: str | os.PathLike[str],
    name: str | None = None,
    *,
    run: Run | None = None,
    **settings: Any,
) -> list[Path]:
    """Write a terrain and return the files: ``export(terrain, "alps.obj")``.

    Parameters
    ----------
    surface
        The terrain.
    path
        The main file.
    name
        An exporter; by default the one for the path's extension.
    run
        Seed and so on, for the record inside the files.
    settings
        The exporter's parameters.
    """
    target = Path(path)
    subject = surface_of(surface), target
    written: list[Path] = _made(name or exporter_for(target), "exporter", settings, subject, run)
    return written


def analyze(surface: Heightfield) -> Analysis:
    """Return the yardsticks that tell land from noise, with the bands of real land."""
    from terrakit.analysis import analyze as measure

    if not isinstance(surface, Heightfield):
        raise InputError("analyze: works on a Heightfield")
    return measure(surface.elevation, surface.spacing)


def importer_of(path: Path) -> type[Importer]:
    """Return the importer that recognises the content of a file."""
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        with open(path, "rb") as stream:
            head = stream.read(HEAD_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if not head:
        raise InputError(f"{path.name}: is empty")
    importers: list[type[Importer]] = []
    for built_in in (True, False):  # a broken plugin cannot harm what needs none
        known_now = default_registry().operators("importer", built_in)
        importers = [kind for kind in known_now if issubclass(kind, Importer)]
        for kind in importers:
            if kind.recognises(path, head):
                return kind
    known = ", ".join(sorted({s for kind in importers for s in kind.suffixes}))
    raise InputError(f"{path.name}: of no known format (read: {known}){_guess(head)}")


def exporter_for(path: Path) -> str:
    """Return the name of the exporter that writes files with this extension."""
    suffix = path.suffix.lower()
    written: dict[str, str] = {}
    for built_in in (True, False):  # a broken plugin cannot harm what needs none
        for kind in default_registry().operators("exporter", built_in):
            for extension in (getattr(kind, "suffix", ""), *getattr(kind, "suffixes", ())):
                written.setdefault(extension, kind.name)
        if suffix and suffix in written:
            return written[suffix]
    known = sorted(written)
    shown = suffix or "no extension"
    raise ParameterError(f"{path.name}: {shown}: no exporter writes it (known: {', '.join(known)})")


def _made(name: str, kind: str, settings: dict[str, Any], subject: Any, run: Run | None) -> Any:
    """Run an operator by its name; surfaces among the settings become steps that it may name."""
    operator = default_registry().get(name, kind)
    run = run or Run()
    given = {key: value for key, value in settings.items() if isinstance(value, Surface)}
    if given:
        ledger, run = run.ledger, run.for_step(run.step)
        run.ledger, run.earlier = ledger, {**run.earlier, **given}
        settings = settings | {key: f"{key}.elevation" for key in given}
        for key in given:
            if key in operator.model_fields and is_step_name(operator.model_fields[key]):
                settings[key] = key
    return execute(operator.from_settings(settings, name), subject, run)


def _guess(head: bytes) -> str:
    start = head.lstrip()[:16].lower()
    if start.startswith((b"<!doctype", b"<html")):
        return "; it is a web page, not data: download the file itself"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError:
        return ""
    return "; it is text"
