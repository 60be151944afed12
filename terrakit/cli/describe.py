"""``terrakit describe OPERATOR``."""

from __future__ import annotations

import inspect
import json
from typing import TYPE_CHECKING, Any

import click

from terrakit.cli import options
from terrakit.cli.tables import write_json

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from terrakit.operators import Operator


@options.command("describe")
@click.argument("operator")
@options.json_option
def command(operator: str, as_json: bool) -> None:
    """Explain an operator: what it does, its parameters, layers, presets and papers."""
    from terrakit.registry import default_registry

    kind = default_registry().get(operator)
    if as_json:
        from terrakit.schema import operator_schema

        write_json(operator_schema(kind))
        return
    works_on = " and ".join(surface.__name__ for surface in kind.surfaces)
    click.echo(f"{kind.name}  ({kind.kind}, {default_registry().owner(kind).label})\n")
    click.echo(inspect.getdoc(kind) or "")
    _section("Parameters", [line for item in kind.model_fields.items() for line in _lines(*item)])
    _section("Presets", [f"{name}  {_settings(values)}" for name, values in kind.presets.items()])
    _section(
        "Layers",
        [
            f"{verb:<7} {', '.join(names)}"
            for verb, names in (
                ("reads", kind.reads),
                ("uses", kind.uses),
                ("writes", kind.writes),
            )
            if names
        ]
        + ([f"on      {works_on}"] if kind.kind not in ("generator", "importer") else []),
    )
    _section("Papers", list(kind.cites))
    _section("In a recipe", snippet(kind))


def snippet(kind: type[Operator]) -> list[str]:
    """Return a recipe's step that uses the operator with its defaults, or what it needs besides."""
    lines = ["[[step]]", f'use = "{kind.name}"']
    if kind.kind == "importer":
        suffix = next(iter(getattr(kind, "suffixes", ())), "")
        lines.append(f'file = "terrain{suffix}"')
    shown = {name: field.default for name, field in kind.model_fields.items()} | _needed(kind)
    for name, value in shown.items():
        if isinstance(value, (bool, int, float, str, list, dict)):
            lines.append(f"{name} = {_toml(_plain(value))}")
    return lines


def _needed(kind: type[Operator]) -> dict[str, Any]:
    """Return examples of what an operator cannot do without."""
    from terrakit.errors import ParameterError
    from terrakit.parameters import is_file_path, is_step_name, members_of
    from terrakit.sources import Chain

    try:
        kind()
    except ParameterError:
        needed = dict(kind.trial)
    else:
        return {}
    for name, field in kind.model_fields.items():
        if field.is_required() and Chain in members_of(field.annotation):
            needed[name] = {"use": "fbm"}
        elif field.is_required() and is_step_name(field):
            needed[name] = "fbm"
        elif field.is_required() and is_file_path(field):
            needed[name] = f"{name}.png"
    return needed


def _toml(value: Any) -> str:
    """Return a value as TOML writes it in one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(part)}" for key, part in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(part) for part in value) + "]"
    return json.dumps(value, default=str)


def _lines(name: str, field: FieldInfo) -> list[str]:
    from pydantic import BaseModel

    from terrakit.parameters import bounds_text, type_text, unit_of

    limits = bounds_text(field).replace("x", name) or type_text(field.annotation)
    if field.is_required():
        default = "must be given"
    elif field.default is None:
        default = "none by default"
    else:
        shown = field.default if isinstance(field.default, BaseModel) else _plain(field.default)
        default = f"default {json.dumps(shown, default=str)} {unit_of(field)}".rstrip()
    return [f"{name}  {default}; {limits}", f"    {field.description}"]


def _settings(values: dict[str, Any]) -> str:
    return ", ".join(f"{k} = {json.dumps(_plain(v))}" for k, v in values.items()) or "the defaults"


def _plain(value: Any) -> Any:
    """Return a value with the models in it, such as beds of rock, as the tables that they are."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(value, exclude_none=True)


def _section(title: str, lines: list[str]) -> None:
    if lines:
        click.echo(f"\n{title}")
        for line in lines:
            click.echo(f"  {line}")
