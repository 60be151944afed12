"""Operators inside parameters: chains that make another terrain, and steps that work on this one.

A chain is what stands where another terrain is wanted: one operator that makes ground, and those
that work on it, run one after the other on the very grid that asks for it. Steps are what stands
where an operator runs others, such as a loop: operators that work on the terrain they are given
and keep its samples. In a recipe either is a table ``{ use = "fbm", wavelength = 4000.0 }`` or a
list of such tables; in Python an operator or a list of operators.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    GetJsonSchemaHandler,
    SerializationInfo,
    model_serializer,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from terrakit.errors import ParameterError

if TYPE_CHECKING:
    from terrakit.operators import Operator
    from terrakit.registry import Registry

MOST_LINKS = 100
"""Operators in one chain or list of steps."""
DEEPEST = 8
"""Operators inside operators."""

_depth: ContextVar[int] = ContextVar("terrakit_depth", default=0)
_registry: ContextVar[Registry | None] = ContextVar("terrakit_registry", default=None)


@contextmanager
def looking_in(registry: Registry) -> Iterator[None]:
    """Look nested operators up in ``registry`` inside the block."""
    token = _registry.set(registry)
    try:
        yield
    finally:
        _registry.reset(token)


class Operators(BaseModel):
    """Operators that a parameter holds, to be run one after the other.

    :meth:`read` makes one of an operator, a table with ``use``, or a list of either; a parameter
    of such a type takes those as they are.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    operators: tuple[Any, ...]

    example: ClassVar[str] = "fbm"
    """An operator that may stand here, for messages."""

    @classmethod
    def read(cls, value: Any, name: str = "") -> Self:
        """Return what an operator, a table or a list of them describes.

        Parameters
        ----------
        value
            What was given.
        name
            The parameter, for messages.

        Raises
        ------
        ParameterError
            With the place, the operator, its parameter, the value and the limit.
        """
        if isinstance(value, cls):
            return value
        whole = f"{name}: " if name else ""
        depth = _depth.get() + 1
        if depth > DEEPEST:
            raise ParameterError(f"{whole}nested more than {DEEPEST} deep; make some of it a step")
        token = _depth.set(depth)
        try:
            links = list(value) if isinstance(value, (list, tuple)) else [value]
            if not 1 <= len(links) <= MOST_LINKS:
                raise ParameterError(
                    f"{whole}a list of {len(links)} operators; must be 1 to {MOST_LINKS}"
                )
            operators = []
            for index, link in enumerate(links):
                try:
                    operators.append(_operator(link, cls.example))
                except ParameterError as error:
                    raise ParameterError(f"{cls.place(name, index)}{error}") from None
            cls._check(operators, name)
            return cls(operators=tuple(operators))
        finally:
            _depth.reset(token)

    @classmethod
    def place(cls, name: str, index: int) -> str:
        """Return how messages begin that are about one of the operators."""
        del index
        return f"{name}: " if name else ""

    def within(self, name: str) -> Iterator[tuple[str, Operator]]:
        """Yield every operator, with how messages about it begin."""
        for index, operator in enumerate(self.operators):
            yield f"{self.place(name, index)}{operator.name}: ", operator

    @classmethod
    def _check(cls, operators: Sequence[Operator], name: str) -> None:
        """Raise ParameterError unless these operators may stand here, in this order."""
        raise NotImplementedError

    @model_validator(mode="before")
    @classmethod
    def _from_tables(cls, value: Any) -> Any:
        """Take what a recipe says for the operators that it means."""
        from terrakit.operators import Operator

        if isinstance(value, cls):
            return value
        if isinstance(value, dict) and set(value) == {"operators"}:
            links = value["operators"]
            if isinstance(links, tuple) and all(isinstance(link, Operator) for link in links):
                cls._check(links, "")
                return value
            value = links
        return {"operators": cls.read(value).operators}

    @model_serializer(mode="plain")
    def tables(self, info: SerializationInfo) -> list[dict[str, Any]]:
        """Return the operators as a recipe says them, with every parameter spelled out."""
        return [
            {"use": operator.name, **operator.model_dump(mode=info.mode)}
            for operator in self.operators
        ]

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return a step without a name, or a list of them; a recipe's schema says which."""
        del core_schema, handler
        table = {
            "type": "object",
            "properties": {"use": {"type": "string", "description": "The operator."}},
            "required": ["use"],
        }
        links = {"type": "array", "minItems": 1, "maxItems": MOST_LINKS, "items": table}
        return {"title": cls.__name__, "anyOf": [table, links]}

    def __hash__(self) -> int:
        return hash((type(self), *(operator.name for operator in self.operators)))

    def __str__(self) -> str:
        return " > ".join(operator.name for operator in self.operators)


class Chain(Operators):
    """Operators that make a terrain, one after the other: a generator, then whatever works on it.

    :meth:`read` makes one of an operator, a table with ``use``, or a list of either; a parameter
    that takes a chain takes those as they are.
    """

    @classmethod
    def _check(cls, operators: Sequence[Operator], name: str) -> None:
        """Raise ParameterError unless the first makes a terrain and the others work on it."""
        from terrakit.operators import Exporter, Generator, Importer

        if not operators:
            raise ParameterError("a list of 0 operators; begin with a generator")
        for index, link in enumerate(operators):
            where = f"{cls.place(name, index)}{link.name}"
            if isinstance(link, (Importer, Exporter)):
                raise ParameterError(
                    f"{where}: an {link.kind} cannot stand inside another step; make it a step of "
                    "its own and name that"
                )
            if index == 0 and not isinstance(link, Generator):
                raise ParameterError(f"{where}: needs a terrain; begin with a generator")
            if index > 0 and isinstance(link, Generator):
                raise ParameterError(
                    f"{where}: would discard the terrain of '{operators[index - 1].name}'; a "
                    "generator must be the first"
                )


class Steps(Operators):
    """Operators that work on a given terrain, one after the other, and keep its samples.

    Erosions, textures, and filters that do not change the grid; a parameter of this type makes its
    operator a wrapper around them, such as a loop. :class:`terrakit.passes.Passes` runs them.
    """

    example: ClassVar[str] = "thermal"

    @classmethod
    def place(cls, name: str, index: int) -> str:
        """Return how messages begin that are about one of the operators: ``steps[2] ``."""
        return f"{name or 'steps'}[{index + 1}] "

    def portion(self, start: float, end: float) -> Steps:
        """Return the steps with the part of their time from ``start`` to ``end``, 0 to 1.

        See :meth:`terrakit.operators.Erosion.portion`.
        """
        from terrakit.operators import Erosion

        portions = []
        for index, link in enumerate(self.operators):
            try:
                portions.append(link.portion(start, end) if isinstance(link, Erosion) else link)
            except ParameterError as error:
                raise ParameterError(f"{self.place('', index)}{link.name}: {error}") from None
        return self.model_copy(update={"operators": tuple(portions)})

    @classmethod
    def _check(cls, operators: Sequence[Operator], name: str) -> None:
        """Raise ParameterError unless all work on a terrain and keep its samples."""
        from terrakit.operators import Erosion, Filter, Generator, Texture

        if not operators:
            raise ParameterError("a list of 0 operators; name what works on the terrain")
        for index, link in enumerate(operators):
            where = f"{cls.place(name, index)}{link.name}"
            if isinstance(link, Generator):
                raise ParameterError(
                    f"{where}: would discard the terrain; name an erosion, a filter or a texture"
                )
            if not isinstance(link, (Erosion, Filter, Texture)):
                raise ParameterError(
                    f"{where}: an {link.kind} cannot stand inside another step; make it a step of "
                    "its own"
                )
            if isinstance(link, Filter) and link.changes_grid:
                raise ParameterError(
                    f"{where}: changes the samples, which must stay; make it a step of its own"
                )


class OfSteps:
    """What an operator declares, together with what the steps in its parameter ``steps`` declare.

    ``writes: ClassVar = OfSteps("writes", ("elevation",))`` is that tuple for the class, and for an
    operator also every layer that one of its steps writes. What a step reads is left out if an
    earlier one writes it.
    """

    def __init__(self, name: str, own: Any) -> None:
        self.name = name
        self.own = own

    def __get__(self, operator: Operator | None, kind: type[Operator]) -> Any:
        if operator is None:
            return self.own
        links = operator.steps.operators  # type: ignore[attr-defined]
        join: dict[str, Callable[[list[Any]], Any]] = {
            "fields": lambda found: self.own + max(found),
            "surfaces": lambda found: tuple(s for s in self.own if all(s in one for one in found)),
        }
        if self.name in join:
            return join[self.name]([getattr(link, self.name) for link in links])
        names, written = list(self.own), set[str]()
        for link in links:
            names += [n for n in getattr(link, self.name) if n not in written]
            written |= set(link.writes) if self.name == "reads" else set()
        return tuple(dict.fromkeys(names))


Source = float | str | Chain
"""A terrain: a constant height, an earlier step's name (or ``step.layer``), or a chain."""


def nested_type(annotation: Any) -> type[Operators] | None:
    """Return the type of nested operators that a parameter of this type takes, if any."""
    from terrakit.parameters import members_of

    members = members_of(annotation)
    return next((kind for kind in (Chain, Steps) if kind in members), None)


def is_nested(value: Any, kind: type[Operators]) -> bool:
    """Return whether a value can only be meant for nested operators."""
    from terrakit.operators import Operator

    if isinstance(value, dict):
        return kind is Steps or "use" in value
    return isinstance(value, (Operator, list, tuple))


def operators_within(operator: Operator) -> Iterator[Operator]:
    """Yield the operator and, depth first, every one that its parameters hold."""
    yield operator
    for name in type(operator).model_fields:
        value = getattr(operator, name)
        if isinstance(value, Operators):
            for link in value.operators:
                yield from operators_within(link)


def files_within(operator: Operator, before: str = "") -> Iterator[tuple[str, str]]:
    """Yield the parameter and the path of every file that the operator, or one in it, reads.

    A parameter of a nested operator comes with those around it, so that no name of the outer
    operator stands for it.
    """
    from terrakit.parameters import is_file_path

    for name, field in type(operator).model_fields.items():
        value = getattr(operator, name)
        if isinstance(value, Operators):
            for place, link in value.within(name):
                yield from files_within(link, f"{before}{place}")
        elif isinstance(value, str) and is_file_path(field):
            yield f"{before}{name}", value


@dataclass(frozen=True)
class Reference:
    """A text in a parameter that may name an earlier step."""

    path: str
    """The parameter, with those around it: ``other: fbm: amplitude``."""
    text: str
    role: str
    """``step``: a step's name; ``terrain``: or ``step.layer``; ``layer``: or a layer of its own."""


def references_within(operator: Operator, before: str = "") -> Iterator[Reference]:
    """Yield every text that names terrain in the operator's parameters, and in those within."""
    from terrakit.operators import Generator
    from terrakit.parameters import FromLayer, is_maskable, is_source, is_step_name

    for name, field in type(operator).model_fields.items():
        value = getattr(operator, name)
        path = f"{before}{name}"
        if isinstance(value, Operators):
            for place, link in value.within(name):
                yield from references_within(link, f"{before}{place}")
            continue
        text = value.layer if isinstance(value, FromLayer) else value
        if not isinstance(text, str):
            continue
        if is_step_name(field):
            yield Reference(path, text, "step")
        elif is_source(field.annotation):
            yield Reference(path, text, "terrain")
        elif is_maskable(field.annotation):
            # A generator has no layers of its own, so that a plain name is a step's
            yield Reference(path, text, "terrain" if isinstance(operator, Generator) else "layer")


def _operator(link: Any, example: str) -> Operator:
    """Return the operator that one table describes; ``example`` is for the message of an error."""
    from terrakit.operators import Operator
    from terrakit.registry import default_registry

    if isinstance(link, Operator):
        return link
    if not isinstance(link, dict):
        shown = repr(link)
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise ParameterError(f'{shown}: must be a table such as {{ use = "{example}" }}')
    settings = dict(link)
    use = settings.pop("use", None)
    if not isinstance(use, str) or not use:
        raise ParameterError(f'use is missing; say {{ use = "{example}" }}')
    kind = (_registry.get() or default_registry()).get(use)
    return kind.from_settings(settings, use)
