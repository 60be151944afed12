"""Commands made from operators: an option for each parameter, from its one declaration."""

from __future__ import annotations

import types
import typing
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from terrakit.cli import options
from terrakit.cli.commands import global_options
from terrakit.cli.options import number, toml_value

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from terrakit.operators import Operator
    from terrakit.running import Run


class OperatorGroup(click.Group):
    """The operators of one kind as commands.

    Parameters
    ----------
    kind
        ``generator``, ``filter``, ``erosion`` or ``texture``.
    work
        Called with the context, the operator and the values of ``shared``.
    shared
        Arguments and options that every command of this kind has.
    """

    def __init__(
        self, name: str, kind: str, work: Callable[..., None], shared: list[Any], help: str
    ) -> None:
        super().__init__(name, help=help, subcommand_metavar="NAME [ARGS]...")
        self.kind = kind
        self.work = work
        self.shared = shared

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of every operator of the kind."""
        del ctx
        from terrakit.registry import default_registry

        return [operator.name for operator in default_registry().operators(self.kind)]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command:
        """Return the command for one operator; its name may carry its distribution."""
        del ctx
        from terrakit.registry import default_registry

        operator = default_registry().get(cmd_name, self.kind)
        work = self.work

        @click.pass_context
        def run(context: click.Context, /, **values: Any) -> None:
            own = {
                name: values.pop(name)
                for name in [*names, "preset"]
                if name in values
                and context.get_parameter_source(name) is not ParameterSource.DEFAULT
            }
            for name in [*names, "preset"]:
                values.pop(name, None)
            settings = {names.get(name, name): value for name, value in own.items()}
            work(context, operator.from_settings(settings, operator.name), **values)

        for decorate in reversed(self.shared):
            run = decorate(run)
        run = global_options(hidden=True)(run)
        command = click.command(cmd_name, help=operator.summary(), short_help=operator.summary())(
            run
        )
        taken = {flag for p in command.params for flag in (*p.opts, *p.secondary_opts)}
        names: dict[str, str] = {}
        for field_name, field in operator.model_fields.items():
            flag = field_name.replace("_", "-")
            if f"--{flag}" in taken:
                flag = f"{operator.name.replace('_', '-')}-{flag}"
            names[f"own_{field_name}"] = field_name
            command.params.append(_option(f"own_{field_name}", flag, field))
        if operator.presets:
            command.params.append(
                click.Option(
                    ["--preset"],
                    type=click.Choice(sorted(operator.presets)),
                    help="A named set of parameters, under those given here.",
                )
            )
        return command


class FieldType(click.ParamType):  # type: ignore[type-arg]
    """A value of a pydantic field; whether it is allowed is decided by the operator."""

    def __init__(self, annotation: Any, name: str) -> None:
        self.annotation = annotation
        self.name = name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, table or text that the field may take."""
        if not isinstance(value, str):
            return value
        from terrakit.parameters import Seed

        members = _members(self.annotation)
        if self.annotation == Seed:
            return options.SeedType().convert(value, param, ctx)
        if members & {int, float}:
            found = number(value.strip())
            if found is not None:
                return found
        parsed = toml_value(value)
        if isinstance(parsed, (dict, list)) and members - {int, float, str}:
            return parsed
        return value


def _option(name: str, flag: str, field: FieldInfo) -> click.Option:
    from terrakit.parameters import bounds_text

    limits = bounds_text(field).replace("x", "value")
    default = "" if field.default is None or field.is_required() else _default_text(field)
    facts = "; ".join(filter(None, [limits, default]))
    about: dict[str, Any] = {"help": f"{field.description}{f'  [{facts}]' if facts else ''}"}
    if field.annotation is bool:
        return click.Option([f"--{flag}/--no-{flag}", name], default=None, **about)
    choices = _choices(field.annotation)
    if choices is not None:
        kind: click.ParamType[Any] = click.Choice(choices)
    else:
        kind = FieldType(field.annotation, _metavar(field))
    return click.Option([f"--{flag}", name], type=kind, **about)


def _default_text(field: FieldInfo) -> str:
    from terrakit.parameters import unit_of

    value = field.default
    if isinstance(value, bool):
        return "default on" if value else "default off"
    shown = f"{value:g}" if isinstance(value, (int, float)) else str(value)
    return f"default {shown} {unit_of(field)}".rstrip()


def _metavar(field: FieldInfo) -> str:
    from terrakit.parameters import is_maskable, is_source, is_step_name
    from terrakit.sources import nested_type

    if is_maskable(field.annotation):
        return "number|layer|table"
    if is_source(field.annotation):
        return "number|file|table"
    if nested_type(field.annotation) is not None:
        return "tables"
    if is_step_name(field):
        return "file"
    members = _members(field.annotation)
    if float in members:
        return "number"
    if int in members:
        return "integer" if str not in members else "seed"
    return "text" if str in members else "value"


def _members(annotation: Any) -> set[Any]:
    """Return the alternatives of a union, without None."""
    union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    members = typing.get_args(annotation) if union else (annotation,)
    return {typing.get_origin(m) or m for m in members} - {type(None)}


def _choices(annotation: Any) -> list[str] | None:
    """Return the words of a Literal, also of one that may be None."""
    arguments = [annotation, *typing.get_args(annotation)]
    for literal in arguments:
        if typing.get_origin(literal) is typing.Literal:
            words = typing.get_args(literal)
            return list(words) if all(isinstance(word, str) for word in words) else None
    return None


def input_and_output(source: bool) -> list[Any]:
    """Return the shared arguments and options of a kind: with a file to read, or without."""
    first: list[Any] = [click.argument("source", metavar="IN"), options.import_option]
    return [
        *(first if source else []),
        click.argument("target", metavar="OUT"),
        options.export_option,
        options.seed_option,
        options.device_option,
    ]


def work_on_file(
    context: click.Context,
    operator: Operator,
    source: str,
    import_settings: Mapping[str, Any],
    target: str,
    export_settings: Mapping[str, Any],
    seed: int | str | None,
    device: str | None,
) -> None:
    """Read a terrain, hand it to the operator, write what comes back."""
    from terrakit.cli.files import named_files, reader, writer
    from terrakit.execute import execute

    read, read_named = reader(source, dict(import_settings)), named_files(operator)
    write = writer(target, dict(export_settings))

    def make(run: Run) -> Any:
        run.earlier = read_named(run)
        return execute(operator, read(run), run)

    finish(context, operator, seed, device, write, make)


def finish(
    context: click.Context,
    operator: Operator,
    seed: int | str | None,
    device: str | None,
    write: Callable[..., Any],
    make: Callable[[Any], Any],
) -> None:
    """Make a surface under the eyes of the user, write it and name the files."""
    import time

    from terrakit.cli.interruption import INTERRUPTION
    from terrakit.cli.messages import Settings, shown
    from terrakit.cli.progress import Reporter
    from terrakit.compute import choose_device
    from terrakit.running import Run

    settings = context.find_object(Settings)
    assert settings is not None
    reporter = Reporter(settings)
    chosen = choose_device(device)
    reporter.say(f"device  {chosen.label}")
    run = Run(0 if seed is None else seed, chosen, reporter.update)
    with INTERRUPTION.cancelling(run.cancel), reporter.showing():
        started = time.perf_counter()
        surface = make(run)
        reporter.done(operator.name, time.perf_counter() - started)
        written = write(surface, run)
    if not settings.is_quiet:
        for path in written:
            click.echo(shown(path))
