"""Runs one operator and checks, at the border, what it was given and what it returns."""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from terrakit.errors import InputError, ParameterError, PluginError, ResourceError, TerrakitError
from terrakit.heightfield import Grid, Heightfield
from terrakit.layers import covers
from terrakit.mesh import TriMesh
from terrakit.operators import (
    Erosion,
    Exporter,
    Filter,
    Generator,
    Importer,
    Operator,
    Surface,
    Texture,
)
from terrakit.running import Run, place_of

SMALLEST = 3
"""Samples a side below which erosion and texturing have nothing to work on."""


def execute(operator: Operator, subject: Any, run: Run) -> Any:
    """Run ``operator`` on a grid, a surface or a path, and return its checked result.

    Parameters
    ----------
    operator
        The operator with its parameters.
    subject
        A :class:`Grid` for generators, a path for importers, a surface for the others.
    run
        Seed, device, progress and ledger; the ledger is filled by erosions.

    Raises
    ------
    TerrakitError
        What the operator raised on purpose.
    PluginError
        If it raised anything else, tried to exit, or returned what it did not declare.
    """
    run = run if run.step else run.for_step(operator.name)
    if not isinstance(operator, (Generator, Importer)):
        _check_subject(operator, subject)
    samples = _samples(subject)
    if isinstance(operator, Filter) and isinstance(subject, Heightfield):
        samples = max(samples, _samples(_guarded(operator, subject.grid, run, announce=True)))
    check_memory(operator, samples)
    if isinstance(operator, (Generator, Filter, Erosion)):
        _check_device_memory(operator, samples, run)
    run.check()
    with run.watching(grid_under(subject)):
        result = _guarded(operator, subject, run)
    run.check()
    if isinstance(operator, (Generator, Importer, Filter, Texture, Erosion)):
        _check_surface(operator, subject, result)
    if isinstance(operator, (Filter, Texture, Erosion)):
        result = _with_beds(subject, result)
    if isinstance(operator, Erosion) and not run.ledger.is_closed:
        raise PluginError(f"{_label(operator)}: left its ledger open")
    if isinstance(operator, Exporter):
        result = _checked_paths(operator, result)
    return result


def memory_needed(operator: Operator, samples: int) -> int:
    """Return the bytes that ``operator`` needs at its peak for this many samples."""
    return samples * operator.fields * 4


def check_memory(operator: Operator, samples: int) -> None:
    """Raise ResourceError if the operator would need more memory than there is."""
    needed, free = memory_needed(operator, samples), free_memory()
    if needed > free:
        raise ResourceError(
            f"{operator.name}: {samples} samples x {operator.fields} fields = "
            f"{needed / 1e9:.1f} GB > {free / 1e9:.1f} GB free; use fewer samples"
        )


def _check_device_memory(operator: Operator, samples: int, run: Run) -> None:
    """Raise ResourceError before a device is asked for more than it has: PoCL would abort."""
    device, needed = run.device_info, memory_needed(operator, samples)
    if device.is_opencl and needed > device.memory:
        raise ResourceError(
            f"{operator.name}: {samples} samples x {operator.fields} fields = "
            f"{needed / 1e9:.1f} GB > {device.memory / 1e9:.1f} GB of device {device.label}; "
            "use fewer samples or --device numpy"
        )


def free_memory() -> int:
    """Return the bytes that this process may still take."""
    limits = []
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                limits.append(int(line.split()[1]) * 1024)
    except OSError:
        pages = getattr(os, "sysconf", lambda _: 0)
        limits.append(pages("SC_PHYS_PAGES") * pages("SC_PAGE_SIZE"))
    try:
        import resource

        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
        if soft != resource.RLIM_INFINITY:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            limits.append(max(0, soft - used))
    except (ImportError, OSError):
        pass
    known = [limit for limit in limits if limit > 0]
    return min(known) if known else 2**62


def _guarded(operator: Operator, subject: Any, run: Run, announce: bool = False) -> Any:
    """Call the operator's verb; turn everything unexpected into one line with its name.

    ``announce`` asks a filter for the grid of its result instead.
    """
    try:
        with np.errstate(all="warn"):
            if isinstance(operator, Generator):
                return operator.generate(subject, run)
            if isinstance(operator, Filter):
                return operator.grid_after(subject) if announce else operator.apply(subject, run)
            if isinstance(operator, Erosion):
                return operator.erode(subject, run)
            if isinstance(operator, Texture):
                return operator.texture(subject, run)
            if isinstance(operator, Importer):
                return operator.load(subject, run)
            if isinstance(operator, Exporter):
                surface, path = subject
                return operator.export(surface, path, run)
    except (InputError, ParameterError) as error:
        raise _named(operator, error) from error
    except (TerrakitError, KeyboardInterrupt):
        raise
    except MemoryError as error:
        raise ResourceError(f"{operator.name}: out of memory; use fewer samples") from error
    except SystemExit as error:
        raise PluginError(
            f"{_label(operator)}: tried to end the program (exit {error.code})"
        ) from error
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(frame.filename)}:{frame.lineno}"
        text = " ".join(str(error).split())[:300]
        raise PluginError(
            f"{_label(operator)}: raised {type(error).__name__} at {place}: {text}"
        ) from error
    raise TypeError(f"{operator!r} is no operator")


def _named(operator: Operator, error: InputError | ParameterError) -> TerrakitError:
    """Return the error with the name of the operator, which whoever wrote it could not know."""
    if isinstance(operator, Generator) and isinstance(error, InputError):
        return PluginError(f"{_label(operator)}: {error}")  # it had no input: it made rubbish
    if isinstance(operator, Importer) or str(error).startswith(f"{operator.name}: "):
        return error
    return type(error)(f"{operator.name}: {error}")


def _label(operator: Operator) -> str:
    from terrakit.registry import default_registry

    owner = default_registry().owner(type(operator))
    return f"plugin {owner.label}: {operator.name}"


def grid_under(subject: Any) -> Grid | None:
    """Return the grid that an operator works on; None for meshes and files."""
    if isinstance(subject, tuple):
        subject = subject[0]
    if isinstance(subject, Heightfield):
        return subject.grid
    return subject if isinstance(subject, Grid) else None


def _samples(subject: Any) -> int:
    if isinstance(subject, tuple):
        subject = subject[0]
    if isinstance(subject, (Grid, Heightfield)):
        return subject.shape[0] * subject.shape[1]
    return len(subject.vertices) if isinstance(subject, TriMesh) else 0


def _check_subject(operator: Operator, subject: Any) -> None:
    surface: Any = subject[0] if isinstance(operator, Exporter) else subject
    works: tuple[Any, ...] = operator.surfaces
    if not isinstance(surface, works):
        works_on = " or ".join(kind.__name__ for kind in operator.surfaces)
        raise InputError(f"{operator.name}: works on a {works_on}, not a {type(surface).__name__}")
    for name in operator.reads:
        if name.endswith("_"):
            if not any(covers((name,), present) for present in surface):
                raise InputError(f"{operator.name}: needs a layer {name}*; the terrain has none")
        elif name not in surface:
            known = ", ".join(surface)
            raise InputError(
                f"{operator.name}: needs layer {name!r}; it has: {known}{_writers(name)}"
            )
    if isinstance(operator, (Erosion, Texture)) and isinstance(surface, Heightfield):
        rows, cols = surface.shape
        if min(rows, cols) < SMALLEST:
            raise InputError(
                f"{operator.name}: the terrain has {rows}x{cols} samples, needs at least "
                f"{SMALLEST}x{SMALLEST}"
            )


def _writers(layer: str) -> str:
    """Return which steps would write a layer, as the end of a message."""
    from terrakit.registry import default_registry

    names = [
        kind.name
        for kind in default_registry().operators()
        if layer in kind.writes and layer not in (*kind.reads, *kind.uses)
    ]
    return f"; {' or '.join(names[:3])} would write it" if names else ""


def _check_surface(operator: Operator, subject: Any, result: Any) -> None:
    """Check type, shape, values and layers of what an operator returned."""
    if not isinstance(result, (Heightfield, TriMesh)):
        raise PluginError(f"{_label(operator)}: returned {_described(result)}, must be a terrain")
    before: Iterable[str] = subject if isinstance(subject, (Heightfield, TriMesh)) else ()
    if isinstance(subject, Grid) and isinstance(result, Heightfield) and result.grid != subject:
        raise PluginError(
            f"{_label(operator)}: returned a terrain of shape {result.shape}, asked for "
            f"{subject.shape} on the same grid"
        )
    may_move = isinstance(operator, Filter) and operator.changes_grid
    if isinstance(operator, Filter) and may_move:
        _check_moved(operator, subject, result)
    elif isinstance(subject, (Heightfield, TriMesh)):
        same = type(result) is type(subject) and (
            result.grid == subject.grid
            if isinstance(result, Heightfield) and isinstance(subject, Heightfield)
            else len(result.vertices) == len(subject.vertices)  # type: ignore[union-attr]
        )
        if not same:
            raise PluginError(f"{_label(operator)}: changed the grid of the terrain")
    for name in result:
        layer = result.layers.get(name) if isinstance(result, Heightfield) else None
        if isinstance(subject, Heightfield) and layer is not None:
            if layer is subject.layers.get(name):
                continue
        elif (
            isinstance(subject, TriMesh)
            and name in subject
            and result.layer(name) is subject.layer(name)
        ):
            continue
        moved = may_move and name in before  # every layer comes along to the new grid
        if (
            isinstance(operator, (Generator, Filter, Erosion, Texture))
            and not moved
            and not covers(operator.writes, name)
        ):
            raise PluginError(
                f"{_label(operator)}: wrote layer {name!r}, which it does not declare"
            )
        if layer is not None:
            wrong = layer.not_finite()
        else:
            wrong = int((~np.isfinite(result.layer(name))).sum())
        if wrong:
            raise PluginError(f"{_label(operator)}: {wrong} values of {name} are not finite")
    missing = [name for name in before if name not in result]
    if missing:
        raise PluginError(f"{_label(operator)}: dropped layer {missing[0]!r}")


def _with_beds(subject: Surface, result: Surface) -> Surface:
    """Return the result with the beds of the surface that it was made from."""
    if result.strata is None and subject.strata is not None:
        return result.with_strata(subject.strata)
    return result


def _check_moved(operator: Filter, subject: Any, result: Any) -> None:
    """Check that a filter that changes the grid lands where it said it would."""
    if type(result) is not type(subject):
        raise PluginError(
            f"{_label(operator)}: turned a {type(subject).__name__} into a {type(result).__name__}"
        )
    if isinstance(subject, Heightfield):
        expected = operator.grid_after(subject.grid)
        if expected is not None and result.grid != expected:
            raise PluginError(
                f"{_label(operator)}: returned {place_of(result.grid)}, announced "
                f"{place_of(expected)}"
            )


def _checked_paths(operator: Operator, result: Any) -> list[Path]:
    if not isinstance(result, list) or not result:
        raise PluginError(f"{_label(operator)}: returned {_described(result)}, must list its files")
    absent = [path for path in result if not Path(path).is_file()]
    if absent:
        raise PluginError(f"{_label(operator)}: says it wrote {absent[0]}, which is not there")
    return [Path(path) for path in result]


def _described(value: Any) -> str:
    shape = getattr(value, "shape", None)
    return f"{type(value).__name__} {shape}" if shape is not None else repr(value)[:80]


def surface_of(value: Any) -> Surface:
    """Return ``value`` if it is a surface.

    Raises
    ------
    InputError
        If it is anything else; an array needs its spacing first.
    """
    if isinstance(value, (Heightfield, TriMesh)):
        return value
    raise InputError(
        f"needs a Heightfield or TriMesh, got {_described(value)}; "
        "for an array use Heightfield(array, spacing)"
    )
