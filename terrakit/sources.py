"""Terrains inside parameters: a number, the name of an earlier step, or a chain of operators.

A chain is what stands where another terrain is wanted: one operator that makes ground, and those
that work on it, run one after the other on the very grid that asks for it. In a recipe it is a
table ``{ use = "fbm", wavelength = 4000.0 }`` or a list of such tables; in Python an operator or a
list of operators.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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
"""Operators in one chain."""
DEEPEST = 8
"""Chains inside chains."""

_depth: ContextVar[int] = ContextVar("terrakit_depth", default=0)
_registry: ContextVar[Registry | None] = ContextVar("terrakit_registry", default=None)


@contextmanager
def looking_in(registry: Registry) -> Iterator[None]:
    """Look the operators of chains up in ``registry`` inside the block."""
    token = _registry.set(registry)
    try:
        yield
    finally:
        _registry.reset(token)


class Chain(BaseModel):
    """Operators that make a terrain, one after the other: a generator, then whatever works on it.

    :meth:`read` makes one of an operator, a table with ``use``, or a list of either; a parameter
    that takes a chain takes those as they are.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    operators: tuple[Any, ...]

    @classmethod
    def read(cls, value: Any) -> Chain:
        """Return the chain that an operator, a table or a list of them describes.

        Raises
        ------
        ParameterError
            With the operator, its parameter, the value and the limit.
        """
        if isinstance(value, Chain):
            return value
        depth = _depth.get() + 1
        if depth > DEEPEST:
            raise ParameterError(f"nested more than {DEEPEST} deep; make some of it a step")
        token = _depth.set(depth)
        try:
            links = list(value) if isinstance(value, (list, tuple)) else [value]
            if not 1 <= len(links) <= MOST_LINKS:
                raise ParameterError(f"a list of {len(links)} operators; must be 1 to {MOST_LINKS}")
            operators = tuple(_operator(link) for link in links)
            _check_order(operators)
            return cls(operators=operators)
        finally:
            _depth.reset(token)

    @model_validator(mode="before")
    @classmethod
    def _from_tables(cls, value: Any) -> Any:
        """Take what a recipe says for the operators that it means."""
        from terrakit.operators import Operator

        if isinstance(value, Chain):
            return value
        if isinstance(value, dict) and set(value) == {"operators"}:
            links = value["operators"]
            if isinstance(links, tuple) and all(isinstance(link, Operator) for link in links):
                _check_order(links)
                return value
            value = links
        return {"operators": Chain.read(value).operators}

    @model_serializer(mode="plain")
    def tables(self, info: SerializationInfo) -> list[dict[str, Any]]:
        """Return the chain as a recipe says it, with every parameter spelled out."""
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
        return {"title": "Chain", "anyOf": [table, links]}

    def __hash__(self) -> int:
        return hash((Chain, *(operator.name for operator in self.operators)))

    def __str__(self) -> str:
        return " > ".join(operator.name for operator in self.operators)


Source = float | str | Chain
"""A terrain: a constant height, an earlier step's name (or ``step.layer``), or a chain."""


def is_chain_like(value: Any) -> bool:
    """Return whether a value can only be meant for a chain."""
    from terrakit.operators import Operator

    if isinstance(value, dict):
        return "use" in value
    return isinstance(value, (Operator, list, tuple))


def operators_within(operator: Operator) -> Iterator[Operator]:
    """Yield the operator and, depth first, every one that its parameters hold."""
    yield operator
    for name in type(operator).model_fields:
        value = getattr(operator, name)
        if isinstance(value, Chain):
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
        if isinstance(value, Chain):
            for link in value.operators:
                yield from files_within(link, f"{before}{name}: {link.name}: ")
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
    """Yield every text that names terrain in the operator's parameters and those of its chains."""
    from terrakit.operators import Generator
    from terrakit.parameters import FromLayer, is_maskable, is_source, is_step_name

    for name, field in type(operator).model_fields.items():
        value = getattr(operator, name)
        path = f"{before}{name}"
        if isinstance(value, Chain):
            for link in value.operators:
                yield from references_within(link, f"{path}: {link.name}: ")
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


def _operator(link: Any) -> Operator:
    """Return the operator that one table describes."""
    from terrakit.operators import Operator
    from terrakit.registry import default_registry

    if isinstance(link, Operator):
        return link
    if not isinstance(link, dict):
        shown = repr(link)
        shown = shown if len(shown) <= 60 else shown[:57] + "..."
        raise ParameterError(f'{shown}: must be a table such as {{ use = "fbm" }}')
    settings = dict(link)
    use = settings.pop("use", None)
    if not isinstance(use, str) or not use:
        raise ParameterError('use is missing; say { use = "fbm" }')
    kind = (_registry.get() or default_registry()).get(use)
    return kind.from_settings(settings, use)


def _check_order(links: Sequence[Operator]) -> None:
    """Raise ParameterError unless the first makes a terrain and the others work on it."""
    from terrakit.operators import Exporter, Generator, Importer

    if not links:
        raise ParameterError("a list of 0 operators; begin with a generator")
    for index, link in enumerate(links):
        if isinstance(link, (Importer, Exporter)):
            raise ParameterError(
                f"{link.name}: an {link.kind} cannot stand inside another step; make it a step of "
                "its own and name that"
            )
        if index == 0 and not isinstance(link, Generator):
            raise ParameterError(f"{link.name}: needs a terrain; begin with a generator")
        if index > 0 and isinstance(link, Generator):
            raise ParameterError(
                f"{link.name}: would discard the terrain of '{links[index - 1].name}'; a generator "
                "must be the first"
            )
