"""Runs a recipe: from its first step to its files and the record of how they came to be."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from terrakit import atomic
from terrakit.errors import InputError, OutputError, ParameterError, RecipeError, ResourceError
from terrakit.execute import check_memory, execute, memory_needed
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Exporter, Generator, Importer, Operator, Surface
from terrakit.provenance import terrakit_version, version_of
from terrakit.recipe import DEFAULT_MAX_CELLS, Recipe, Step, check_cells
from terrakit.registry import Registry, default_registry
from terrakit.results import ResultCache
from terrakit.running import Run
from terrakit.sources import files_within, operators_within

RECORD = "run.json"
"""The file that says how the others came to be."""


@dataclass(frozen=True)
class Result:
    """What a run made."""

    surface: Surface
    """The terrain of the last step that made one."""
    files: list[Path] = field(default_factory=list)
    """Every file written, ``run.json`` last."""
    report: dict[str, Any] = field(default_factory=dict)
    """The content of ``run.json``."""


def run_recipe(
    recipe: Recipe,
    run: Run,
    out: Path | None = None,
    *,
    cache: ResultCache | None = None,
    registry: Registry | None = None,
    max_cells: int = DEFAULT_MAX_CELLS,
    on_step: Callable[[Step, dict[str, Any]], None] | None = None,
) -> Result:
    """Run ``recipe`` and return its terrain, files and record.

    Parameters
    ----------
    recipe
        The recipe; its seed is ``run.seed``.
    run
        Device, progress, cancel; the sea level is the recipe's.
    out
        Folder for the files; without it exporters are left out.
    cache
        Earlier results; a step is computed only if its operator, parameters, input, the steps
        that it names, seed or code changed.
    registry
        Whose observers are told.
    max_cells
        Most samples that a generator or an importer may make, whatever the recipe says.
    on_step
        Called after each step with its entry of the record.

    Raises
    ------
    TerrakitError
        Before anything is computed where the problem can be known by then.
    """
    registry = registry or default_registry()
    registry.load_observers()
    check_recipe(recipe, out, max_cells)
    with _fresh_folder(out):
        return _run_steps(_bounded(recipe, max_cells), run, out, cache, registry, on_step)


def check_recipe(
    recipe: Recipe, out: Path | None = None, max_cells: int = DEFAULT_MAX_CELLS
) -> None:
    """Raise what can be known before the first step: samples, memory, disk, output places.

    Parameters
    ----------
    recipe
        The recipe.
    out
        Folder for the files; without it exporters are left out.
    max_cells
        Most samples that a generator may be asked for.
    """
    steps = _steps(recipe, out)
    for index, step in enumerate(recipe.steps, start=1):
        if isinstance(step.operator, Importer) and not source_path(recipe, step).is_file():
            path = source_path(recipe, step)
            problem = "is not a regular file" if path.exists() else "no such file"
            raise InputError(f"{recipe.name}: step {index} '{step.name}': {path}: {problem}")
        _check_files(recipe, step, f"{recipe.name}: step {index} '{step.name}'")
    grids = recipe.grids()
    _check_sizes(recipe, steps, grids, max_cells)
    if out is not None:
        _check_outputs(recipe, steps, out)
        _check_disk(steps, grids, out)


def _check_files(recipe: Recipe, step: Step, where: str) -> None:
    """Raise InputError unless every file that a step's parameters name is there."""
    run = Run(folder=recipe.folder)
    for name, text in files_within(step.operator):
        try:
            path = run.file(text)
        except ParameterError as error:
            raise RecipeError(f"{where}: {name} = {error}") from None
        if not path.is_file():
            problem = "is not a regular file" if path.exists() else "no such file"
            raise InputError(f"{where}: {name} = {text!r}: {problem}")


def _bounded(recipe: Recipe, max_cells: int) -> Recipe:
    """Return the recipe with the importers' own limits lowered to that of the run."""
    steps = []
    for step in recipe.steps:
        operator = step.operator
        limit = getattr(operator, "max_cells", None)
        if isinstance(operator, Importer) and limit is not None and limit > max_cells:
            operator = operator.model_copy(update={"max_cells": max_cells})
        steps.append(replace(step, operator=operator))
    return replace(recipe, steps=tuple(steps))


def _steps(recipe: Recipe, out: Path | None) -> list[Step]:
    return [s for s in recipe.steps if out is not None or not isinstance(s.operator, Exporter)]


@contextlib.contextmanager
def _fresh_folder(out: Path | None) -> Iterator[None]:
    """Remove the folder again, if it is new and empty, where the run fails."""
    absent = [p for p in (out, *out.absolute().parents) if not p.exists()] if out else []
    try:
        yield
    except BaseException:
        for folder in absent:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise


def _run_steps(
    recipe: Recipe,
    run: Run,
    out: Path | None,
    cache: ResultCache | None,
    registry: Registry,
    on_step: Callable[[Step, dict[str, Any]], None] | None,
) -> Result:
    steps = _steps(recipe, out)
    registry.tell("terrakit_run_started", run=run, steps=[step.name for step in steps])
    last_use = _last_uses(steps, recipe.result)
    surfaces: dict[str, Surface] = {}
    keys: dict[str, str] = {}
    world = run.world or recipe.grid
    entries: list[dict[str, Any]] = []
    files: list[Path] = []
    for index, step in enumerate(steps, start=1):
        where = f"{recipe.name}: step {index} '{step.name}'"
        started = time.perf_counter()
        step_run = run.for_step(step.name)
        step_run.sea_level = recipe.header.sea_level
        step_run.world = world
        step_run.folder = recipe.folder
        step_run.earlier = {**run.earlier, **{name: surfaces[name] for name in step.names}}
        entry: dict[str, Any] = {"name": step.name, "use": step.use}
        try:
            if isinstance(step.operator, Exporter):
                assert step.input is not None
                assert out is not None
                surface = surfaces[step.input]
                target = _target(recipe, step, out)
                atomic.make_folder(target.parent)
                written = execute(step.operator, (surface, target), step_run)
                files += [path for path in written if path not in files]  # shared textures
                entry["files"] = [path.name for path in written]
            else:
                subject = _subject(recipe, step, surfaces)
                key = keys[step.name] = _key(recipe, step, step_run, subject, keys)
                kept = cache.load(key) if cache is not None else None
                entry["cached"] = kept is not None
                if kept is not None:
                    surface, entry["ledger"] = kept
                else:
                    surface = execute(step.operator, subject, step_run)
                    entry["ledger"] = step_run.ledger.to_dict()
                    if cache is not None and not run.is_finishing:
                        cache.store(key, surface, entry["ledger"])
                surfaces[step.name] = surface
                if world is None and isinstance(surface, Heightfield):
                    world = surface.grid
        except (ParameterError, InputError) as error:
            message = str(error).removeprefix(f"{step.use}: ")
            raise type(error)(f"{where}: {message}") from error
        entry["seconds"] = round(time.perf_counter() - started, 3)
        entry["cites"] = _cites([step])
        entries.append(entry)
        registry.tell(
            "terrakit_step_done", run=step_run, step=step.name, surface=surface, report=entry
        )
        if on_step is not None:
            on_step(step, entry)
        del surface
        subject = kept = None  # or they would keep the input of the last step that made terrain
        for name in [name for name in surfaces if last_use[name] <= index]:
            del surfaces[name]
    report = _report(recipe, run, registry, steps, entries, files)
    if out is not None:
        text = json.dumps(report, indent=2, ensure_ascii=False) + "\n"
        # A name that is not UTF-8 holds lone surrogates, which JSON can say as escapes
        content = text.encode("utf-8", "backslashreplace")
        files.append(atomic.write_bytes(atomic.make_folder(out) / RECORD, content))
    registry.tell("terrakit_run_finished", run=run, report=report)
    return Result(surfaces[recipe.result.name], files, report)


def _last_uses(steps: list[Step], result: Step) -> dict[str, int]:
    """Return, by step, the number of the last one that needs its surface."""
    last = {step.name: index for index, step in enumerate(steps, start=1)}
    for index, step in enumerate(steps, start=1):
        for name in (*step.names, *([step.input] if step.input is not None else [])):
            last[name] = index
    last[result.name] = len(steps) + 1
    return last


def _check_sizes(
    recipe: Recipe, steps: list[Step], grids: dict[str, Grid | None], max_cells: int
) -> None:
    """Raise what the grids tell before the first step: samples, memory, limits of formats."""
    for index, step in enumerate(steps, start=1):
        before = grids[step.input] if step.input is not None else None
        after = grids[step.name]
        sizes = [grid.shape[0] * grid.shape[1] for grid in (before, after) if grid is not None]
        try:
            if after is not None:
                try:
                    check_cells(after, max_cells)
                except RecipeError as error:
                    where = "" if after == recipe.grid else f"step {index} '{step.name}': "
                    raise RecipeError(f"{recipe.name}: {where}{error}") from None
            for operator in operators_within(step.operator):
                check_memory(operator, max(sizes, default=0))
            if isinstance(step.operator, Exporter) and after is not None:
                step.operator.check(after)
        except (ParameterError, InputError, ResourceError) as error:
            raise type(error)(f"{recipe.name}: step {index} '{step.name}': {error}") from None


def _check_outputs(recipe: Recipe, steps: list[Step], out: Path) -> None:
    exporters = [step for step in steps if isinstance(step.operator, Exporter)]
    targets: dict[Path, Step] = {}
    try:
        existing = next(p for p in (out, *out.absolute().parents) if p.exists() or p.is_symlink())
    except OSError as error:
        raise atomic.explain_os_error(error, out) from None
    if not existing.is_dir():
        raise OutputError(f"{existing}: a file is in the way of a folder; choose another --out")
    probe = existing / ".terrakit" if existing != out else out / RECORD
    atomic.writable_target(probe)
    for step in exporters:
        target = _target(recipe, step, out)
        if target == out / RECORD:
            raise RecipeError(
                f"{recipe.name}: step '{step.name}': file = '{RECORD}': is the record of the run; "
                "choose another name"
            )
        if target in targets:
            other = targets[target]
            raise RecipeError(
                f"{recipe.name}: steps '{other.name}' and '{step.name}' both write {target.name}; "
                'give one of them file = "..."'
            )
        targets[target] = step
        if target.parent.is_dir():
            atomic.writable_target(target)


def _check_disk(steps: list[Step], grids: dict[str, Grid | None], out: Path) -> None:
    import shutil

    needed = disk_needed(steps, grids)
    existing = next(p for p in (out, *out.absolute().parents) if p.exists())
    free = shutil.disk_usage(existing).free
    if needed > free:
        raise ResourceError(
            f"{out}: no space left: needs about {needed / 1e6:.0f} MB, {free / 1e6:.0f} MB are "
            "free; choose another place with --out"
        )


def disk_needed(steps: Iterable[Step], grids: dict[str, Grid | None]) -> float:
    """Return about how many bytes the exporters among ``steps`` write, as far as that is known."""
    needed = 0.0
    for step in steps:
        grid = grids[step.name]
        if isinstance(step.operator, Exporter) and grid is not None:
            needed += step.operator.bytes_a_sample * grid.shape[0] * grid.shape[1]
    return needed


def memory_of(step: Step, grids: dict[str, Grid | None]) -> int | None:
    """Return the bytes that a step needs at its peak, or None where its size is not yet known."""
    before = grids[step.input] if step.input is not None else None
    sizes = [g.shape[0] * g.shape[1] for g in (before, grids[step.name]) if g is not None]
    if not sizes:
        return None
    return max(memory_needed(operator, max(sizes)) for operator in operators_within(step.operator))


def _target(recipe: Recipe, step: Step, out: Path) -> Path:
    assert isinstance(step.operator, Exporter)
    return out / (step.file or recipe.name + step.operator.suffix)


def _subject(recipe: Recipe, step: Step, surfaces: dict[str, Surface]) -> Any:
    """Return what a step works on: a grid, a file, or the terrain of its input."""
    if isinstance(step.operator, Importer):
        return source_path(recipe, step)
    if step.input is None:
        return recipe.grid
    surface = surfaces[step.input]
    if not isinstance(step.operator, Generator):
        return surface
    if not isinstance(surface, Heightfield):
        raise InputError(f"input = {step.input!r}: is a mesh, which has no grid to be made on")
    return surface.grid


def source_path(recipe: Recipe, step: Step) -> Path:
    """Return the file that an importing step reads, which must lie where recipes may read."""
    assert step.file is not None
    if step.trusted:
        return Path(step.file).expanduser()
    path = (recipe.folder / step.file).resolve()
    if not path.is_relative_to(recipe.folder.resolve()):
        raise RecipeError(
            f"{recipe.name}: step '{step.name}': file = {step.file!r}: leaves the recipe's folder"
        )
    return path


def _key(recipe: Recipe, step: Step, run: Run, subject: Any, keys: dict[str, str]) -> str:
    """Return what the result of a step depends on, as a digest."""
    within = list(operators_within(step.operator))
    parts: dict[str, Any] = {
        "use": step.use,
        "code": sorted({_code_digest(_package(operator)) for operator in within}),
        "settings": step.operator.model_dump(mode="json"),
        "seed": [type(run.seed).__name__, run.seed],
        "sea_level": recipe.header.sea_level,
        "world": _place(run.world),
        "named": {name: keys[name] for name in step.names},
    }
    if any(operator.parity != "exact" for operator in within):
        parts["device"] = run.device_info.label
    if isinstance(subject, Grid):
        parts["grid"] = _place(subject)
    elif isinstance(step.operator, Importer):
        parts["file"] = _file_digest(subject)
    else:
        assert step.input is not None
        parts["before"] = keys[step.input]
    files = [run.file(path) for _, path in files_within(step.operator)]
    if files:
        parts["files"] = [_file_digest(path) for path in files]
    text = json.dumps(parts, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _place(grid: Grid | None) -> list[Any] | None:
    return None if grid is None else [grid.shape, grid.spacing, grid.origin, grid.crs]


def _package(operator: Operator) -> str:
    return type(operator).__module__.partition(".")[0]


def _cites(steps: Iterable[Step]) -> list[str]:
    """Return the papers behind these steps, and behind what is nested in them."""
    return list(
        dict.fromkeys(
            cite
            for step in steps
            for operator in operators_within(step.operator)
            for cite in operator.cites
        )
    )


@lru_cache(maxsize=64)
def _code_digest(package: str) -> str:
    """Return a digest of the sources of terrakit and of the operator's package."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted({"terrakit", package}):
        origin = getattr(sys.modules.get(name), "__file__", None)
        if origin is None:
            continue
        module = Path(origin)
        found = module.parent.rglob("*") if module.name == "__init__.py" else [module]
        for path in sorted(p for p in found if p.suffix in (".py", ".cl")):
            digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def _file_digest(path: Path) -> str:
    digest = hashlib.sha256()
    try:
        with open(path, "rb") as stream:
            while block := stream.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    return digest.hexdigest()


def _report(
    recipe: Recipe,
    run: Run,
    registry: Registry,
    steps: list[Step],
    entries: list[dict[str, Any]],
    files: list[Path],
) -> dict[str, Any]:
    owners = {
        registry.owner(type(operator))
        for step in steps
        for operator in operators_within(step.operator)
    }
    return {
        "terrakit": terrakit_version(),
        "recipe": recipe.with_seed(run.seed).to_dict(),
        "device": {"name": run.device_info.label, "version": run.device_info.version},
        "versions": {
            "python": platform.python_version(),
            **{name: version_of(name) for name in ("numpy", "pyopencl", "pydantic", "pluggy")},
            **{owner.distribution: owner.version for owner in owners},
        },
        "steps": entries,
        "outputs": [
            {"file": path.name, "bytes": path.stat().st_size, "sha256": _file_digest(path)}
            for path in files
        ],
        "cites": sorted(_cites(steps)),
    }
