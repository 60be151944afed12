"""Checks of what an operator declares: every kind of operator passes these."""

from __future__ import annotations

import json
import math
import pickle
import re
import types
import typing
from typing import Any

from pydantic.fields import FieldInfo

from terrakit.errors import TerrakitError
from terrakit.operators import Erosion, Filter, Operator, Texture
from terrakit.parameters import (
    Seed,
    bounds_of,
    check_bounds,
    is_file_path,
    is_maskable,
    is_source,
    is_step_name,
    unit_of,
)
from terrakit.registry import FAMILIES, check_declaration, default_registry
from terrakit.sources import Chain, Steps
from terrakit.testing.subjects import irregular_mesh, rough_terrain, with_layers
from terrakit.testing.trial import Trial, refusing

UNIT = re.compile(
    r"^(|%|1|px|(mm|cm|km|m|kg|g|s|min|h|yr|deg|Pa|W|K|J|N)(\d|\^-?\d|\^\([^)]*\))?"
    r"([*/](mm|cm|km|m|kg|g|s|min|h|yr|deg|Pa|W|K|J|N)(\d|\^-?\d|\^\([^)]*\))?)*|1/\w+)$"
)


def declares_itself(trial: Trial) -> None:
    """Name, kind, summary and a described parameter each, units that exist, one verb."""
    operator = trial.operator
    base = next((b for b in FAMILIES.values() if issubclass(operator, b)), None)
    if base is None:
        raise trial.broken("is no Generator, Filter, Erosion, Texture, Importer or Exporter")
    try:
        check_declaration(operator, base)
    except TypeError as error:
        raise trial.broken(f"declaration is not whole: {error}") from error
    if operator.kind != base.kind:
        raise trial.broken(f"kind is {operator.kind!r}, of a {base.__name__} {base.kind!r}")
    if not operator.summary().endswith("."):
        raise trial.broken(f"summary is no sentence: {operator.summary()!r}")
    if operator.parity not in ("exact", "statistical"):
        raise trial.broken(f"parity is {operator.parity!r}, must be 'exact' or 'statistical'")
    if operator.locality not in ("pointwise", "stencil", "global"):
        raise trial.broken(f"locality is {operator.locality!r}")
    for name, field in operator.model_fields.items():
        if not str(field.description).rstrip().endswith((".", "?", ")")):
            raise trial.broken(f"{name}: description is no sentence: {field.description!r}")
        if not UNIT.match(unit_of(field)):
            raise trial.broken(f"{name}: {unit_of(field)!r} is no SI unit, deg or yr")
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise trial.broken(f"parameter {name!r} is not lower_case")
    lasts = getattr(operator, "lasts", {})
    for name in (*operator.idle, *(operator.turning or {}), *trial.settings, *lasts):
        if name not in operator.model_fields:
            raise trial.broken(
                f"idle, turning, trial or lasts names {name!r}, which is no parameter"
            )


def defaults_are_within_bounds(trial: Trial) -> None:
    """Every default obeys the bounds beside it, and the defaults make an operator."""
    for name, field in trial.operator.model_fields.items():
        if field.is_required():
            continue
        try:
            check_bounds(name, field, field.get_default(call_default_factory=True))
        except ValueError as error:
            raise trial.broken(f"default of {name} = {field.default!r} {error}") from error
    trial.made()


def presets_are_valid(trial: Trial) -> None:
    """Every preset makes an operator, and a given setting goes before the preset's."""
    required = {n: trial.settings[n] for n in trial.settings if _required(trial.operator, n)}
    for preset in trial.operator.presets:
        try:
            trial.operator.from_settings({**required, "preset": preset}, "preset")
        except TerrakitError as error:
            raise trial.broken(f"preset {preset!r} is refused: {error}") from error


def schema_builds(trial: Trial) -> None:
    """JSON Schema builds, and carries description and bounds of every parameter."""
    schema = trial.operator.model_json_schema()
    json.dumps(schema)
    for name, field in trial.operator.model_fields.items():
        shown = schema["properties"].get(name, {})
        if "description" not in shown:
            raise trial.broken(f"JSON Schema of {name} lacks its description")
        for key, bound in bounds_of(field).items():
            if shown.get(key) != bound:
                raise trial.broken(f"JSON Schema of {name} has {key} {shown.get(key)}, not {bound}")


def settings_survive_a_recipe(trial: Trial) -> None:
    """Settings written as JSON and read again make an equal, frozen operator; so does a pickle."""
    operator = trial.made()
    written = json.loads(json.dumps(operator.model_dump(mode="json")))
    given = {name: value for name, value in written.items() if value is not None}
    try:
        again = trial.operator(**given)
    except TerrakitError as error:
        raise trial.broken(f"refuses its own settings after JSON: {error}") from error
    if again != operator:
        raise trial.broken(f"JSON turns {operator!r} into {again!r}")
    if pickle.loads(pickle.dumps(operator)) != operator:
        raise trial.broken(f"a pickle of {operator!r} is not equal to it")


def parameters_mean_the_same_everywhere(trial: Trial) -> None:
    """A parameter's name has one unit and one type of value in every operator known here."""
    mine = {n: (unit_of(f), _category(f)) for n, f in trial.operator.model_fields.items()}
    for other in default_registry().operators():
        if other is trial.operator or other.name == trial.operator.name:
            continue
        for name, field in other.model_fields.items():
            theirs = unit_of(field), _category(field)
            if name in mine and mine[name] != theirs:
                raise trial.broken(
                    f"{name} is {' '.join(mine[name]).strip()!r}, but "
                    f"{' '.join(theirs).strip()!r} in {other.name}; use another name"
                )


def unknown_parameters_are_refused(trial: Trial) -> None:
    """A misspelt parameter is refused, and the right one suggested."""
    for name in trial.operator.model_fields:
        wrong = name[:-1] + "x" + name[-1] if len(name) > 4 else name + "_wrong"
        with refusing(trial, f"the unknown parameter {wrong!r}") as message:
            trial.operator(**{**trial.settings, wrong: 1})
        if wrong not in message[0]:
            raise trial.broken(f"does not name the unknown {wrong!r}: {message[0]}")
        if len(name) > 4 and "did you mean" not in message[0]:
            raise trial.broken(f"suggests nothing for {wrong!r}: {message[0]}")
    with refusing(trial, "the unknown parameter 'no_such_thing'"):
        trial.operator(**{**trial.settings, "no_such_thing": 1})


def values_out_of_bounds_are_refused(trial: Trial) -> None:
    """Values beyond a bound, NaN, infinities and wrong types raise one line that names them."""
    for name, field in trial.operator.model_fields.items():
        wrong: list[Any] = [[[]], object()]
        if _category(field) in ("number", "terrain"):
            wrong += [math.nan, math.inf, -math.inf]
        for key, bound in bounds_of(field).items():
            outward = 1.0 if "max" in key.lower() else -1.0
            wrong.append(bound if "exclusive" in key else bound + outward * (abs(bound) + 1))
        for value in wrong:
            with refusing(trial, f"{name} = {value!r}") as message:
                trial.operator(**{**trial.settings, name: value})
            if name not in message[0]:
                raise trial.broken(f"does not name {name} when refusing {value!r}: {message[0]}")


def other_surfaces_are_refused(trial: Trial) -> None:
    """What it does not work on, is too small or lacks a layer is refused in one line."""
    from terrakit.execute import execute
    from terrakit.heightfield import Heightfield
    from terrakit.mesh import TriMesh
    from terrakit.running import Run

    operator = trial.made()
    verb = trial.operator.kind
    takes = issubclass(trial.operator, (Filter, Erosion, Texture))
    trial.needs(takes, f"a {verb} takes no surface")
    wrong: list[tuple[str, Any]] = [("a plain array", rough_terrain().elevation)]
    if TriMesh not in trial.operator.surfaces:
        wrong.append(("a mesh", with_layers(trial.operator, irregular_mesh())))
    if Heightfield not in trial.operator.surfaces:
        wrong.append(("a heightfield", with_layers(trial.operator, rough_terrain())))
    elif not issubclass(trial.operator, Filter):
        wrong.append(("a terrain of 2x2", with_layers(trial.operator, rough_terrain((2, 2)))))
    if set(trial.operator.reads) - {"elevation"} and Heightfield in trial.operator.surfaces:
        wrong.append(("a terrain without its layers", rough_terrain()))
    for what, surface in wrong:
        with refusing(trial, what):
            execute(operator, surface, Run(device=trial.device))


def _required(operator: type[Operator], name: str) -> bool:
    field = operator.model_fields.get(name)
    return field is not None and field.is_required()


def _category(field: FieldInfo) -> str:
    """Return what a value of the parameter is in the eyes of a user."""
    annotation: Any = field.annotation
    if annotation == Seed:
        return "seed"
    if is_maskable(annotation):
        return "number"
    if is_source(annotation) or annotation is Chain:
        return "terrain"
    if annotation is Steps:
        return "steps"
    if is_step_name(field):
        return "step"
    if is_file_path(field):
        return "file"
    choices = [a for a in typing.get_args(annotation) if a is not type(None)]
    if len(choices) == 1 and typing.get_origin(annotation) in (typing.Union, types.UnionType):
        annotation = choices[0]
    if annotation in (int, float):
        return "number"
    if annotation is bool:
        return "switch"
    if annotation is str or typing.get_origin(annotation) is typing.Literal:
        return "word"
    return str(annotation)
