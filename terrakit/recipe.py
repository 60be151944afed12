"""Recipes: what a run is made of, as a TOML file without any code in it.

A recipe is a header (``size`` in metres, ``spacing`` or ``samples``, ``seed``, ``sea_level``) and
``[[step]]`` tables. A step names its operator with ``use``; every other key is one of that
operator's parameters. Unknown keys are errors. A step works on the terrain of the step before it,
or of the one that ``input`` names; a generator or importer begins another branch.

Paths in a recipe are relative to the recipe's folder and may not leave it, so that a recipe from
elsewhere reads nothing but what came with it. Paths given on the command line or in Python may be
anywhere. Nothing in a recipe is expanded or run.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from terrakit.errors import InputError, ParameterError, RecipeError
from terrakit.heightfield import Grid
from terrakit.layers import layer_kind
from terrakit.operators import Exporter, Filter, Generator, Importer, Operator
from terrakit.parameters import Seed, explain, suggestion
from terrakit.registry import Registry, default_registry
from terrakit.running import seed_words
from terrakit.sources import files_within, looking_in, references_within

FORMAT = 1
LARGEST_FILE = 2**20
MOST_STEPS = 1000
RESERVED = ("use", "name", "input", "file", "preset")
DEFAULT_MAX_CELLS = 2**28


class Header(BaseModel):
    """The keys of a recipe outside its steps."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    format: int = Field(FORMAT, description="Version of the recipe format.")
    title: str = Field("", description="One line for people.")
    description: str = Field("", description="What the terrain is.")
    seed: Seed = Field(0, description="Any integer or text; everything random follows from it.")
    size: float | list[float] | None = Field(
        None, description="Extent in metres: one number, or west-east and south-north."
    )
    spacing: float | None = Field(None, description="Distance between samples, metres.")
    samples: int | list[int] | None = Field(
        None, description="Samples a side: one number, or columns and rows."
    )
    origin: list[float] | None = Field(
        None, description="World x and y of the south-west corner, metres."
    )
    sea_level: float | None = Field(None, description="Height of the sea, metres; none without it.")


@dataclass(frozen=True)
class Step:
    """One step: its operator, and the file that an importer or exporter names."""

    name: str
    operator: Operator
    file: str | None = None
    trusted: bool = False
    """Whether ``file`` was given by the user rather than by the recipe."""
    input: str | None = None
    """The step whose terrain it works on; of a generator, the one on whose grid it is made."""

    @property
    def use(self) -> str:
        """The operator's name."""
        return self.operator.name

    @property
    def is_source(self) -> bool:
        """Whether it begins a branch."""
        return isinstance(self.operator, (Generator, Importer))

    @property
    def names(self) -> tuple[str, ...]:
        """The earlier steps that its parameters name."""
        found = []
        for reference in references_within(self.operator):
            step, dot, _ = reference.text.partition(".")
            if dot or reference.role != "layer":
                found.append(step)
        return tuple(dict.fromkeys(found))


@dataclass(frozen=True)
class Recipe:
    """A validated recipe.

    Parameters
    ----------
    name
        Stem of the files that it writes.
    header
        Size, resolution, seed, sea level.
    steps
        At least one; the first makes or reads a terrain.
    folder
        Where relative paths begin.
    """

    name: str
    header: Header
    steps: tuple[Step, ...]
    folder: Path = field(default_factory=Path.cwd)

    @property
    def grid(self) -> Grid | None:
        """Where a generator's samples lie; None where an importer decides."""
        return grid_of(self.header)

    @property
    def result(self) -> Step:
        """The step whose terrain is the recipe's: the last that is no exporter."""
        return [step for step in self.steps if not isinstance(step.operator, Exporter)][-1]

    def grids(self) -> dict[str, Grid | None]:
        """Return, by step, the grid of its result (of an exporter: what it writes).

        None stands where only a run can tell: after an importer, and where a filter cannot say.
        """
        grids: dict[str, Grid | None] = {}
        for index, step in enumerate(self.steps, start=1):
            before = grids[step.input] if step.input is not None else None
            if isinstance(step.operator, Generator) and step.input is None:
                grids[step.name] = self.grid
            elif isinstance(step.operator, Importer):
                grids[step.name] = None
            elif isinstance(step.operator, Filter) and step.operator.changes_grid:
                try:
                    after = None if before is None else step.operator.grid_after(before)
                except (ParameterError, InputError) as error:
                    where = f"{self.name}: step {index} '{step.name}'"
                    raise type(error)(f"{where}: {error}") from None
                grids[step.name] = after
            else:
                grids[step.name] = before
        return grids

    def with_seed(self, seed: Seed) -> Recipe:
        """Return the recipe with another seed."""
        seed_words(seed)
        return replace(self, header=self.header.model_copy(update={"seed": seed}))

    def to_dict(self) -> dict[str, Any]:
        """Return the recipe with every parameter spelled out, as ``run.json`` holds it."""
        steps = []
        for step in self.steps:
            entry: dict[str, Any] = {"use": step.use, "name": step.name}
            if step.input is not None:
                entry["input"] = step.input
            if step.file is not None:
                entry["file"] = Path(step.file).name if step.trusted else step.file
            entry |= step.operator.model_dump(mode="json")
            steps.append(entry)
        header = self.header.model_dump(mode="json", exclude_none=True)
        return {"name": self.name, **header, "step": steps}


def shipped() -> list[str]:
    """Return the names of the recipes that come with terrakit."""
    folder = resources.files("terrakit") / "recipes"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def shipped_titles() -> dict[str, str]:
    """Return the title of every recipe that comes with terrakit, by name."""
    folder = resources.files("terrakit") / "recipes"
    return {
        name: str(tomllib.loads((folder / f"{name}.toml").read_text("utf-8")).get("title", ""))
        for name in shipped()
    }


def load_recipe(
    source: str | os.PathLike[str] | Mapping[str, Any],
    settings: Mapping[str, Any] | None = None,
    registry: Registry | None = None,
) -> Recipe:
    """Return the validated recipe in a file, of a shipped name, or from a mapping.

    Parameters
    ----------
    source
        Path of a ``.toml`` file, name of a shipped recipe, or a mapping of the same structure.
    settings
        Changes: ``{"step.parameter": value}``, or ``{"size": value}`` for the header.
    registry
        Where operators are looked up; by default everything installed.

    Raises
    ------
    RecipeError
        With the file or step, the key, the value, the limit and the way out.
    """
    registry = registry or default_registry()
    if isinstance(source, Mapping):
        return _parse(dict(source), "recipe", "recipe", Path.cwd(), settings or {}, registry, True)
    path = Path(source)
    if str(source) in shipped() and not path.is_file():
        resource = resources.files("terrakit") / "recipes" / f"{source}.toml"
        text, name, folder = resource.read_text("utf-8"), str(source), Path.cwd()
        shown = f"{source}.toml"
    else:
        text, name, folder, shown = _read(path), path.stem, path.resolve().parent, path.name
    try:
        document = tomllib.loads(text)
    except ValueError as error:  # tomllib's own, or a number of more than 4300 digits
        raise RecipeError(f"{shown}: {error}; a recipe is TOML") from None
    except RecursionError:
        raise RecipeError(f"{shown}: nested too deeply") from None
    return _parse(document, name, shown, folder, settings or {}, registry, False)


def header_of(settings: dict[str, Any], where: str) -> Header:
    """Return the header with these keys; ``where`` begins the message of an error."""
    try:
        return Header.model_validate(settings)
    except ValidationError as error:
        raise RecipeError(explain(error, Header, where)) from None


def grid_of(header: Header) -> Grid | None:
    """Return the grid that a header describes, or None if it gives no size.

    Raises
    ------
    RecipeError
        If the header gives too much or too little.
    """
    given = [key for key in ("size", "spacing", "samples") if getattr(header, key) is not None]
    if not given:
        return None
    if len(given) != 2:
        which = ", ".join(given)
        raise RecipeError(
            f"header gives {which}: give two of size, spacing and samples (size in metres)"
        )
    if header.samples is not None:
        cols, rows = (int(n) for n in _pair(header.samples, "samples"))
        if min(cols, rows) < 2:
            raise RecipeError(f"samples = {header.samples}: must be >= 2")
    if header.spacing is not None and not header.spacing > 0:
        raise RecipeError(f"spacing = {header.spacing:g}: must be > 0 m")
    if header.size is not None:
        width, height = _pair(header.size, "size")
        if min(width, height) <= 0:
            raise RecipeError(f"size = {header.size}: must be > 0 m")
        if header.spacing is not None:
            if max(width, height) / header.spacing > 2**24:
                raise RecipeError(
                    f"size = {header.size}: at spacing {header.spacing:g} m that is more than "
                    "16777216 samples a side; raise spacing"
                )
            cols, rows = (round(side / header.spacing) + 1 for side in (width, height))
            spacing = header.spacing
        else:
            spacing = width / (cols - 1)
            if not math.isclose(spacing, height / (rows - 1), rel_tol=1e-6):
                raise RecipeError(
                    f"samples = {header.samples} over size = {header.size}: cells are "
                    f"{spacing:g} x {height / (rows - 1):g} m, they must be square"
                )
    else:
        assert header.spacing is not None
        spacing = header.spacing
    west, south = _pair(header.origin, "origin") if header.origin else (0.0, 0.0)
    return Grid((rows, cols), spacing, (west, south + (rows - 1) * spacing))


def check_cells(grid: Grid, limit: int = DEFAULT_MAX_CELLS) -> None:
    """Raise RecipeError if ``grid`` has more samples than ``limit``."""
    cells = grid.shape[0] * grid.shape[1]
    if cells > limit:
        raise RecipeError(
            f"{grid.shape[0]}x{grid.shape[1]} = {cells} samples > {limit}; "
            "raise spacing, or allow more with --max-cells"
        )


def _pair(value: Any, key: str) -> tuple[float, float]:
    if isinstance(value, list):
        if len(value) != 2:
            raise RecipeError(f"{key} = {value}: must be one number or two")
        return value[0], value[1]
    return value, value


def _read(path: Path) -> str:
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except OSError as error:
        raise RecipeError(f"{str(path)[:80]}: cannot be read ({error.strerror})") from None
    if path.is_dir():
        raise RecipeError(f"{path}: is a folder; name a .toml file or one of: {_names()}")
    if not path.exists():
        hint = suggestion(str(path), shipped()) if path.suffix != ".toml" else ""
        raise RecipeError(f"{path}: no such recipe{hint}; name a .toml file or one of: {_names()}")
    if not path.is_file():
        raise RecipeError(f"{path}: is not a regular file; name a .toml file")
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise RecipeError(f"{path}: {path.stat().st_size} bytes > {LARGEST_FILE}; no recipe")
        content = path.read_bytes()
    except OSError as error:
        raise RecipeError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecipeError(
            f"{path.name}: byte {error.start} is not UTF-8; a recipe is UTF-8 TOML"
        ) from None
    if not text.strip():
        raise RecipeError(f"{path.name}: is empty; needs at least one [[step]]")
    return text


def _names() -> str:
    return ", ".join(shipped())


def _parse(
    document: dict[str, Any],
    name: str,
    shown: str,
    folder: Path,
    settings: Mapping[str, Any],
    registry: Registry,
    trusted: bool,
) -> Recipe:
    document = dict(document)
    tables = document.pop("step", None)
    if tables is None:
        misspelt = [k for k in document if isinstance(document[k], list)]
        hint = suggestion(misspelt[0], ["step"]) if misspelt else ""
        raise RecipeError(f"{shown}: has no [[step]]{hint}")
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        raise RecipeError(f'{shown}: step must be [[step]] tables, each with use = "..."')
    if not 1 <= len(tables) <= MOST_STEPS:
        raise RecipeError(f"{shown}: {len(tables)} steps; must be 1 to {MOST_STEPS}")
    tables = [dict(table) for table in tables]
    version = document.get("format", FORMAT)
    if isinstance(version, int) and version > FORMAT:
        raise RecipeError(f"{shown}: made for recipe format {version}, this is {FORMAT}; update")
    names = _step_names(tables, shown)
    given = _apply(settings, document, tables, names, shown)
    header = header_of(document, shown)
    try:
        seed_words(header.seed)
        grid = grid_of(header)
        steps = []
        for index, (step_name, table) in enumerate(zip(names, tables, strict=True), start=1):
            where = f"{shown}: step {index} '{step_name}'"
            own = {key for step, key in given if step == step_name}
            steps.append(_step(step_name, table, where, registry, trusted, own))
        steps = _connected(steps, shown, grid)
    except RecipeError as error:
        message = str(error)
        raise RecipeError(message if message.startswith(shown) else f"{shown}: {message}") from None
    return Recipe(name, header, tuple(steps), folder)


def _step_names(tables: list[dict[str, Any]], shown: str) -> list[str]:
    names: list[str] = []
    for index, table in enumerate(tables, start=1):
        use = table.get("use")
        if not isinstance(use, str) or not use:
            raise RecipeError(f'{shown}: step {index}: use is missing; say use = "fbm"')
        name = table.pop("name", None)
        if name is None:
            bare = use.rpartition(":")[2]
            name, count = bare, 1
            while name in names:
                count += 1
                name = f"{bare}_{count}"
        elif not isinstance(name, str) or not name or "." in name:
            raise RecipeError(f"{shown}: step {index}: name = {name!r}: must be text without dots")
        elif name in names:
            first = names.index(name) + 1
            raise RecipeError(f"{shown}: steps {first} and {index} are both named '{name}'")
        names.append(name)
    return names


def _apply(
    settings: Mapping[str, Any],
    document: dict[str, Any],
    tables: list[dict[str, Any]],
    names: list[str],
    shown: str,
) -> set[tuple[str, str]]:
    """Put the user's changes into the document; return the (step, key) pairs that changed."""
    changed = set()
    for key, value in settings.items():
        step, dot, parameter = key.partition(".")
        if not dot:
            if key not in Header.model_fields:
                hint = suggestion(key, [*Header.model_fields, *names])
                raise RecipeError(f"{shown}: --set {key}: no such key{hint}; steps need step.key")
            document[key] = value
            if key in ("size", "spacing", "samples"):
                _drop_third(document, key)
        elif step not in names:
            raise RecipeError(f"{shown}: --set {key}: no step '{step}'{suggestion(step, names)}")
        else:
            _put(tables[names.index(step)], parameter, value, f"{shown}: --set {key}")
            changed.add((step, parameter))
    return changed


def _put(table: dict[str, Any], path: str, value: Any, where: str) -> None:
    """Put a value into a step's table, or into a table nested in it: ``other.wavelength``.

    In a list of tables a number from 1 says which is meant, or the operator's name where one
    table uses it: ``steps.2.distance``, ``steps.thermal.distance``.
    """
    name, dot, rest = path.partition(".")
    if not dot:
        table[name] = value
        return
    nested = table.get(name)
    if isinstance(nested, list) and all(isinstance(link, dict) for link in nested):
        which, dot, rest = rest.partition(".")
        uses = [link.get("use") for link in nested]
        if which.isdecimal() and 1 <= int(which) <= len(nested):
            index = int(which) - 1
        elif uses.count(which) == 1:
            index = uses.index(which)
        else:
            held = ", ".join(f"{number} {use}" for number, use in enumerate(uses, start=1))
            raise RecipeError(f"{where}: '{name}' has no single '{which}'; say which of: {held}")
        table[name] = links = list(nested)  # what was handed in is not ours to change
        if not dot:
            links[index] = value
            return
        links[index] = dict(nested[index])
        _put(links[index], rest, value, where)
        return
    if not isinstance(nested, dict):
        raise RecipeError(f"{where}: '{name}' is no table here; give all of it: {name} = {{ ... }}")
    table[name] = nested = dict(nested)  # what was handed in is not ours to change
    _put(nested, rest, value, where)


def _drop_third(document: dict[str, Any], key: str) -> None:
    """Keep the extent when the resolution is changed, and the spacing when the size is."""
    other = {"samples": "spacing", "spacing": "samples", "size": "samples"}[key]
    if sum(k in document for k in ("size", "spacing", "samples")) > 2:
        document.pop(other)


def _step(
    name: str,
    table: dict[str, Any],
    where: str,
    registry: Registry,
    trusted: bool,
    given: set[str],
) -> Step:
    """Return a step; ``given`` are the keys that the user set, whose paths may lie anywhere."""
    settings = dict(table)
    use = settings.pop("use")
    try:
        kind = registry.get(use)
    except ParameterError as error:
        raise RecipeError(f"{where}: {error}") from None
    source = settings.pop("input", None)
    if source is not None and not isinstance(source, str):
        raise RecipeError(f"{where}: input = {source!r}: must be the name of an earlier step")
    if source is not None and issubclass(kind, Importer):
        raise RecipeError(f"{where}: input = {source!r}: {use} reads a file; leave input out")
    file = None
    if issubclass(kind, (Importer, Exporter)):
        file = settings.pop("file", None)
        if file is None and issubclass(kind, Importer):
            raise RecipeError(f'{where}: file is missing; say file = "terrain.tif"')
        if file is not None:
            check_path(file, where, trusted or "file" in given)
    try:
        with looking_in(registry):
            operator = kind.from_settings(settings, where)
        for key, path in files_within(operator):
            check_path(path, where, trusted or key in given, key)
        return Step(name, operator, file, trusted or "file" in given, source)
    except ParameterError as error:
        raise RecipeError(str(error)) from None


def check_path(file: Any, where: str, trusted: bool, key: str = "file") -> None:
    """Raise RecipeError if a recipe's path is no relative path inside its own folder."""
    if not isinstance(file, str) or not file or "\0" in file:
        raise RecipeError(f"{where}: {key} = {file!r}: must be a path")
    if trusted:
        return
    parts = Path(file.replace("\\", "/")).parts
    if "://" in file:
        raise RecipeError(f"{where}: {key} = {file!r}: is a URL; download it first")
    if Path(file).is_absolute() or ".." in parts or parts[:1] == ("~",) or ":" in parts[0]:
        raise RecipeError(
            f"{where}: {key} = {file!r}: leaves the recipe's folder; put the file beside the "
            "recipe or give it with --set"
        )


def _connected(steps: list[Step], shown: str, grid: Grid | None) -> list[Step]:
    """Return the steps with every input spelled out, after checking what they name.

    A generator has an input only where its grid comes from another step.
    """
    connected: list[Step] = []
    names = [step.name for step in steps]
    for index, step in enumerate(steps, start=1):
        where = f"{shown}: step {index} '{step.name}'"
        made = [earlier for earlier in connected if not isinstance(earlier.operator, Exporter)]
        before = made[-1].name if made else None
        if not made and not step.is_source:
            raise RecipeError(
                f"{where}: {step.use} needs a terrain; begin with a generator or an importer"
            )
        source = step.input
        if source is not None:
            _check_name("input", source, source, where, connected, names)
        elif not step.is_source or (isinstance(step.operator, Generator) and grid is None):
            source = before
        if isinstance(step.operator, Generator) and grid is None and source is None:
            raise RecipeError(
                f"{where}: {step.use} needs an extent; give size (m) and samples in the header"
            )
        _check_references(step, where, connected, names)
        connected.append(replace(step, input=source))
    _check_use(connected, shown)
    return connected


def _check_references(step: Step, where: str, earlier: list[Step], names: list[str]) -> None:
    """Raise RecipeError unless every step that the parameters name is made by then."""
    for reference in references_within(step.operator):
        named, dot, _ = reference.text.partition(".")
        if reference.role == "layer" and not dot:
            if named in names and layer_kind(named) is None:
                raise RecipeError(
                    f"{where}: {reference.path} = {named!r}: is a step, and a layer is wanted; say "
                    f'"{named}.elevation" for its height'
                )
            continue  # a layer of its own, which only a run can know
        if reference.role == "step" and dot:
            raise RecipeError(
                f"{where}: {reference.path} = {reference.text!r}: must be a step's name alone"
            )
        _check_name(reference.path, reference.text, named, where, earlier, names)


def _check_name(
    key: str, text: str, name: str, where: str, earlier: list[Step], names: list[str]
) -> None:
    """Raise RecipeError unless ``name`` is a step that has made a terrain by then."""
    made = [step.name for step in earlier if not isinstance(step.operator, Exporter)]
    if name in made:
        return
    if name not in names:
        problem = f"no step '{name}'{suggestion(name, made)}"
    elif any(step.name == name for step in earlier):
        problem = f"step '{name}' writes files; name one that makes a terrain: {', '.join(made)}"
    else:
        problem = f"step '{name}' is not yet made; move it further up"
    raise RecipeError(f"{where}: {key} = {text!r}: {problem}")


def _check_use(steps: list[Step], shown: str) -> None:
    """Raise RecipeError if the terrain of a step goes nowhere."""
    used = {name for step in steps for name in step.names}
    used |= {step.input or "" for step in steps if not isinstance(step.operator, Generator)}
    made = [step for step in steps if not isinstance(step.operator, Exporter)]
    for step, after in pairwise(made):
        if step.name not in used:
            index, later = steps.index(step) + 1, steps.index(after) + 1
            raise RecipeError(
                f"{shown}: step {later} '{after.name}' would discard the terrain of step {index} "
                f"'{step.name}'; name it in a later step, e.g. other = \"{step.name}\""
            )


__all__ = [
    "DEFAULT_MAX_CELLS",
    "Header",
    "Recipe",
    "Step",
    "check_cells",
    "grid_of",
    "header_of",
    "load_recipe",
    "shipped",
    "shipped_titles",
]
