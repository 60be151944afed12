"""How an operator declares a parameter, once.

The declaration carries the default, a sentence, the unit and the bounds; recipes, command-line
flags, help, JSON Schema, documentation and the contract tests follow from it.
"""

from __future__ import annotations

import difflib
import math
import types
import typing
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from terrakit.errors import ParameterError
from terrakit.sources import Chain, Source, Steps

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from terrakit.heightfield import Grid
    from terrakit.operators import Surface
    from terrakit.running import Run


class _Setting(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Schedule(_Setting):
    """A value that changes over the run, linear between knots.

    In a recipe: ``{ at = [0.0, 1.0], value = [40.0, 30.0] }``, ``at`` in fractions of the run.
    """

    at: list[float] = Field(min_length=1)
    value: list[float] = Field(min_length=1)

    @model_validator(mode="after")
    def _knots(self) -> Schedule:
        if len(self.at) != len(self.value):
            raise ValueError(f"at has {len(self.at)} knots, value has {len(self.value)}")
        if self.at != sorted(set(self.at)) or self.at[0] < 0 or self.at[-1] > 1:
            raise ValueError("at must rise from 0 to 1 without repeats")
        return self

    def during(self, fraction: float) -> float:
        """Return the value when ``fraction`` of the run is done."""
        import numpy as np

        return float(np.interp(fraction, self.at, self.value))


class FromLayer(_Setting):
    """A value that follows a layer: ``low`` where it is ``at[0]``, ``high`` where it is ``at[1]``.

    In a recipe: ``{ layer = "mask_rain", low = 0.0, high = 2.0 }`` for a mask from 0 to 1, or
    ``{ layer = "elevation", at = [200.0, 900.0], low = 1e-4, high = 1e-3 }``. Linear between the
    two, constant beyond. The layer is the terrain's own, or ``step.layer`` of an earlier step.
    """

    layer: str
    low: float
    high: float
    at: list[float] = Field(default=[0.0, 1.0], min_length=2, max_length=2)

    @model_validator(mode="after")
    def _rising(self) -> FromLayer:
        if not self.at[0] < self.at[1]:
            raise ValueError(f"at = {self.at}: the first must be below the second")
        return self

    def scaled(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the value that each number of the layer stands for."""
        import numpy as np

        start, end = np.float32(self.at[0]), np.float32(self.at[1])
        share = (np.minimum(np.maximum(values, start), end) - start) / (end - start)
        low, high = np.float32(self.low), np.float32(self.high)
        value = low + (high - low) * share
        bounded: NDArray[np.float32] = np.clip(value, min(low, high), max(low, high))
        return bounded


Maskable = float | str | FromLayer | Schedule | Chain
"""A number, a layer's name in the parameter's own unit, a scaled layer, a schedule, or a chain.

A layer is the terrain's own (``sediment``) or an earlier step's (``volcano.sediment``). For a
generator, which has no terrain yet, a plain name is a step whose elevation counts.
"""


class _NamesStep:
    """Marks a text that names an earlier step."""


StepName = Annotated[str, _NamesStep()]
"""The name of an earlier step; :meth:`terrakit.running.Run.named` gives its surface."""


class _NamesFile:
    """Marks a text that names a file to read."""


FilePath = Annotated[str, _NamesFile()]
"""The path of a file to read; :meth:`terrakit.running.Run.file` says where it is."""

Seed = int | str
"""Any integer or text."""


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
    label: str | None = None,
    advanced: bool = False,
) -> Any:
    """Declare a parameter of an operator.

    Parameters
    ----------
    default
        The value when nothing is said, or ``...`` if one must be given.
    description
        One sentence that an artist understands.
    unit
        SI unit or ``deg``, ``yr``; empty for pure numbers and names.
    ge, gt, le, lt
        Bounds, inclusive (``ge``, ``le``) or not, for numbers, schedules and layers alike.
    label
        Short name for panels; by default the parameter's own name in words.
    advanced
        Whether panels hide it at first.
    """
    bounds = {"ge": ge, "gt": gt, "le": le, "lt": lt}
    names = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}
    extra: dict[str, Any] = {
        names[key]: bound for key, bound in bounds.items() if bound is not None
    }
    if unit:
        extra["unit"] = unit
    if advanced:
        extra["advanced"] = True
    return Field(default, description=description, title=label, json_schema_extra=extra)


def members_of(annotation: Any) -> frozenset[Any]:
    """Return the alternatives of a type, without None."""
    union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    members = typing.get_args(annotation) if union else (annotation,)
    return frozenset(members) - {type(None)}


def is_maskable(annotation: Any) -> bool:
    """Return whether a parameter of this type is a :data:`Maskable`, or none."""
    return members_of(annotation) == members_of(Maskable)


def is_source(annotation: Any) -> bool:
    """Return whether a parameter of this type is a :data:`~terrakit.sources.Source`, or none."""
    return members_of(annotation) == members_of(Source)


def is_step_name(field: FieldInfo) -> bool:
    """Return whether a parameter is a :data:`StepName`, or none."""
    return _is_marked(field, _NamesStep)


def is_file_path(field: FieldInfo) -> bool:
    """Return whether a parameter is a :data:`FilePath`, or none."""
    return _is_marked(field, _NamesFile)


def _is_marked(field: FieldInfo, kind: type) -> bool:
    marks = [*field.metadata]
    for member in members_of(field.annotation):
        marks += getattr(member, "__metadata__", ())
    return any(isinstance(mark, kind) for mark in marks)


def bounds_of(field: FieldInfo) -> dict[str, float]:
    """Return the declared bounds by their JSON Schema names."""
    extra = field.json_schema_extra
    if not isinstance(extra, dict):
        return {}
    kept = ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
    return {key: float(extra[key]) for key in kept if key in extra}  # type: ignore[arg-type]


def unit_of(field: FieldInfo) -> str:
    """Return the declared unit, or an empty string."""
    extra = field.json_schema_extra
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def bounds_text(field: FieldInfo) -> str:
    """Return the bounds as a reader says them: ``0 <= x < 90 deg``."""
    bounds = bounds_of(field)
    text = "x"
    if "minimum" in bounds:
        text = f"{bounds['minimum']:g} <= {text}"
    elif "exclusiveMinimum" in bounds:
        text = f"{bounds['exclusiveMinimum']:g} < {text}"
    if "maximum" in bounds:
        text = f"{text} <= {bounds['maximum']:g}"
    elif "exclusiveMaximum" in bounds:
        text = f"{text} < {bounds['exclusiveMaximum']:g}"
    unit = unit_of(field)
    return "" if text == "x" else f"{text} {unit}".rstrip()


def within(field: FieldInfo, low: float, high: float) -> bool:
    """Return whether the range ``low`` to ``high`` lies inside the declared bounds."""
    bounds = bounds_of(field)
    return (
        math.isfinite(low)
        and math.isfinite(high)
        and low >= bounds.get("minimum", -math.inf)
        and low > bounds.get("exclusiveMinimum", -math.inf)
        and high <= bounds.get("maximum", math.inf)
        and high < bounds.get("exclusiveMaximum", math.inf)
    )


def check_bounds(name: str, field: FieldInfo, value: Any) -> None:
    """Raise ValueError if a number, or an end of a schedule or scaled layer, is out of bounds."""
    if isinstance(value, Schedule):
        numbers = value.value
    elif isinstance(value, FromLayer):
        numbers = [value.low, value.high]
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        numbers = [value]
    else:
        return
    try:
        inside = within(field, float(min(numbers)), float(max(numbers)))
    except OverflowError:
        inside = False
    if not inside:
        allowed = bounds_text(field).replace("x", name) or "a finite number"
        raise ValueError(f"must be {allowed}")


def suggestion(word: str, known: list[str]) -> str:
    """Return `` (did you mean ...?)`` for the nearest known word, or the whole list."""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    if close:
        return f" (did you mean {close[0]}?)"
    return f" (known: {', '.join(sorted(known))})" if known else ""


_WITHIN_LISTS = {
    "finite_number": "a finite number",
    "float_type": "a number",
    "too_short": "a list of length {min_length} or more",
    "too_long": "a list of length {max_length} or less",
}
"""What is wanted of the parts of a list, by the kind of problem."""


def explain(error: ValidationError, model: type[BaseModel], where: str) -> str:
    """Return the first problem of a validation as one line that begins with ``where``."""
    problem = error.errors(include_url=False, include_context=False)[0]
    path = [part for part in problem["loc"] if isinstance(part, (str, int))]
    name = str(path[0]) if path else ""
    others = error.error_count() - 1
    more = (
        f" (and {others} more)"
        if others and len({e["loc"][:1] for e in error.errors()}) > 1
        else ""
    )
    if problem["type"] == "extra_forbidden" and len(path) == 1:
        hint = suggestion(name, list(model.model_fields))
        return f"{where}: unknown parameter '{name}'{hint}{more}"
    field = model.model_fields.get(name)
    if field is not None and _lists_tables(field.annotation) and len(path) > 2:
        return f"{where}: {_inside(path, problem)}{more}"
    if problem["type"] == "missing":
        return f"{where}: {name} is missing{more}"
    value = problem["input"]
    inside = "".join(f"[{part + 1}]" for part in path[1:] if isinstance(part, int))
    reason = _reason_within(error) if problem["type"] != "value_error" else None
    if reason is not None:
        return f"{where}: {name} = {_short(value)}: {reason}{more}"
    if inside and problem["type"] in ("list_type", "model_type", "dict_type"):
        wanted = "a list" if problem["type"] == "list_type" else "a table"
        return f"{where}: {name}{inside} = {_short(value)}: must be {wanted}{more}"
    if problem["type"] in _WITHIN_LISTS and (inside or "length" in _WITHIN_LISTS[problem["type"]]):
        wanted = _WITHIN_LISTS[problem["type"]].format(**error.errors()[0].get("ctx", {}))
        return f"{where}: {name}{inside} = {_short(value)}: must be {wanted}{more}"
    if field is not None and problem["type"] != "value_error":
        expected = _expected(name, field)
        return f"{where}: {name} = {_short(value)}: must be {expected}{more}"
    message = problem["msg"].removeprefix("Value error, ")
    shown = f"{name} = {_short(value)}: " if name else ""
    return f"{where}: {shown}{message}{more}"


def _reason_within(error: ValidationError) -> str | None:
    """Return what a schedule or a scaled layer says is wrong with itself, if that is it."""
    for problem in error.errors(include_url=False, include_context=False):
        kind = "".join(str(part) for part in problem["loc"][1:2])
        if problem["type"] == "value_error" and kind.endswith(("Schedule]", "FromLayer]")):
            return str(problem["msg"]).removeprefix("Value error, ")
    return None


def _lists_tables(annotation: Any) -> bool:
    """Return whether a parameter is a list of tables, each with keys of its own."""
    arguments = typing.get_args(annotation)
    return (
        typing.get_origin(annotation) is list
        and isinstance(arguments[0], type)
        and issubclass(arguments[0], BaseModel)
    )


def _inside(path: list[str | int], problem: typing.Any) -> str:
    """Return what is wrong with a key of one of a parameter's tables."""
    place = f"{path[0]}[{int(path[1]) + 1}].{'.'.join(map(str, path[2:]))}"
    if problem["type"] == "missing":
        return f"{place} is missing"
    if problem["type"] == "extra_forbidden":
        return f"{place} = {_short(problem['input'])}: is no such key; leave it out"
    message = problem["msg"].removeprefix("Value error, ").replace("Input should", "must", 1)
    return f"{place} = {_short(problem['input'])}: {message}"


def type_text(annotation: Any) -> str:
    """Return a type as a user reads it."""
    if is_maskable(annotation):
        return "a number, a layer's name, a scaled layer, a schedule or a nested step"
    if is_source(annotation):
        return "a number, an earlier step's name or a nested step"
    if annotation is Chain:
        return "a nested step"
    if annotation is Steps:
        return "a list of nested steps"
    if typing.get_origin(annotation) is Annotated:
        return type_text(typing.get_args(annotation)[0])
    if annotation == Seed:
        return "an integer or text"
    origin = typing.get_origin(annotation)
    if origin is typing.Literal:
        return "one of " + ", ".join(str(choice) for choice in typing.get_args(annotation))
    if origin in (typing.Union, types.UnionType):
        parts = [type_text(a) for a in typing.get_args(annotation) if a is not type(None)]
        return " or ".join(dict.fromkeys(parts))
    plain = {
        int: "a whole number",
        float: "a number",
        bool: "true or false",
        str: "text",
    }
    if annotation in plain:
        return plain[annotation]
    if origin in (list, tuple):
        return "a list"
    if origin is dict:
        return "a table"
    return getattr(annotation, "__name__", str(annotation))


def _expected(name: str, field: FieldInfo) -> str:
    limits = bounds_text(field).replace("x", name)
    kind = type_text(field.annotation)
    if is_step_name(field):
        kind = "an earlier step's name"
    elif is_file_path(field):
        kind = "a file's path"
    return f"{kind}, {limits}" if limits else kind


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def multiplied(name: str, field: FieldInfo, value: Any, factor: float) -> Any:
    """Return a setting that means ``factor`` times as much: of a number, a schedule or a layer.

    Raises
    ------
    ParameterError
        If the values come from a nested step, or from a layer without a bound to scale it by.
    """
    if isinstance(value, FromLayer):
        ends = {"low": value.low * factor, "high": value.high * factor}
        return value.model_copy(update=ends)
    if isinstance(value, Schedule):
        return value.model_copy(update={"value": [number * factor for number in value.value]})
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return value * factor
    largest = bounds_of(field).get("maximum", math.inf)
    if isinstance(value, str) and is_maskable(field.annotation) and math.isfinite(largest):
        least = max(bounds_of(field).get("minimum", -largest), -largest)
        ends = {"low": least * factor, "high": largest * factor}
        return FromLayer(layer=value, at=[least, largest], **ends)
    if isinstance(value, (str, Chain)):
        raise ParameterError(
            f"{name} = '{value}': cannot be shared out; give a number, a schedule or a layer with "
            "low and high"
        )
    return value


def resolve(
    model: BaseModel, name: str, surface: Surface | Grid, fraction: float = 0.0
) -> float | NDArray[np.float32]:
    """Return what a maskable parameter is now: one number, or a field of the surface's shape.

    Parameters
    ----------
    model
        The operator.
    name
        The parameter.
    surface
        The terrain whose layers it may name; a generator's grid, where names are those of steps.
    fraction
        How much of the operator's own work is done, for schedules; inside a loop they go on over
        the whole of it, see :attr:`terrakit.running.Run.span`.

    Raises
    ------
    ParameterError
        If the layer is missing, or its values leave the parameter's bounds.
    """
    from terrakit.running import active_run

    value = getattr(model, name)
    if isinstance(value, (int, float)):
        return float(value)
    run = active_run()
    if isinstance(value, Schedule):
        return value.during(fraction if run is None else run.moment(fraction))
    if isinstance(value, Chain):
        what, field = f"'{value}'", _chained(name, value, surface, run)
    else:
        layer = value.layer if isinstance(value, FromLayer) else str(value)
        what, field = f"layer {layer!r}", _layer(name, layer, surface, run)
    if isinstance(value, FromLayer):
        field = value.scaled(field)
    declared = type(model).model_fields[name]
    low_end, high_end = float(field.min()), float(field.max())
    if not within(declared, low_end, high_end):
        raise ParameterError(
            f"{name}: {what} holds {low_end:g} to {high_end:g}, "
            f"must be {bounds_text(declared).replace('x', name)}"
        )
    return field


def _chained(
    name: str, chain: Chain, surface: Surface | Grid, run: Run | None
) -> NDArray[np.float32]:
    """Return the elevation that a chain makes where the surface lies."""
    from terrakit.heightfield import Grid, Heightfield

    if run is None:
        raise ParameterError(f"{name}: '{chain}' needs a run; call the operator, or execute()")
    if not isinstance(surface, (Grid, Heightfield)):
        raise ParameterError(
            f"{name}: '{chain}' is made on a grid, and this is a mesh; name one of its layers"
        )
    grid = surface if isinstance(surface, Grid) else surface.grid
    return run.terrain(chain, grid).elevation


def _layer(name: str, layer: str, surface: Surface | Grid, run: Run | None) -> NDArray[np.float32]:
    """Return a layer of the surface, or of an earlier step that lies where the surface does."""
    from terrakit.heightfield import Grid
    from terrakit.running import check_same_place, look_up

    if not isinstance(surface, Grid) and layer in surface:
        return surface.layer(layer)
    earlier = run.earlier if run is not None else {}
    if not isinstance(surface, Grid) and "." not in layer and layer not in earlier:
        known = suggestion(layer, list(surface))
        raise ParameterError(f"{name} = {layer!r}: the terrain has no such layer{known}")
    try:
        found, wanted = look_up(layer, earlier)
        check_same_place(layer, found, surface)
    except ParameterError as error:
        raise ParameterError(f"{name} = {error}") from None
    return found.layer(wanted)
