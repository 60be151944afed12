"""The table of commands, and the options that all of them have."""

from __future__ import annotations

import difflib
import importlib
import os
from collections.abc import Callable
from typing import Any, TypeVar

import click

from terrakit.cli.messages import Settings, warnings_are_errors

COMMANDS: dict[str, str] = {
    "run": "Run a recipe: terrain, erosion, texture, files.",
    "validate": "Check a recipe without running it.",
    "generate": "Make a terrain with one generator.",
    "filter": "Reshape the terrain in a file: a curve, a blend, another grid.",
    "erode": "Erode the terrain in a file.",
    "texture": "Add ground materials and colour to the terrain in a file.",
    "convert": "Read a terrain and write it in another format.",
    "preview": "Draw the terrain in a file as a picture.",
    "info": "Say what is in a terrain file.",
    "analyze": "Measure a terrain and compare it with real land.",
    "list": "List operators and shipped recipes.",
    "describe": "Explain an operator: parameters, layers, papers.",
    "plugins": "List plugins, broken ones included.",
    "doctor": "Check devices, kernels and caches.",
}

Decorated = TypeVar("Decorated", bound=Callable[..., Any])


class Commands(click.Group):
    """A group that imports a command when it is run, not to list it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return every command, in the order of the table."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return one command."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"terrakit.cli.{cmd_name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name, or suggest one."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            near = difflib.get_close_matches(name, COMMANDS, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(COMMANDS)}"
            raise click.UsageError(f"no command '{name}' ({hint})", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the table without importing anything."""
        del ctx
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _remember(context: click.Context, parameter: click.Parameter, value: Any) -> None:
    """Note an option in the program's settings."""
    if not value:
        return
    settings = context.find_object(Settings)
    assert settings is not None
    if parameter.name == "verbose":
        settings.verbosity = value
    elif parameter.name == "quiet":
        settings.verbosity = -1
    elif parameter.name == "debug":
        settings.debug = True
    elif parameter.name == "strict":
        settings.strict = True
        warnings_are_errors()
    elif parameter.name == "no_plugins":
        os.environ["TERRAKIT_NO_PLUGINS"] = "1"
    else:
        before = os.environ.get("TERRAKIT_DISABLE", "")
        os.environ["TERRAKIT_DISABLE"] = ",".join([*filter(None, [before]), *value])


def global_options(hidden: bool = False) -> Callable[[Decorated], Decorated]:
    """Return a decorator that adds the options of every command."""
    options = (
        click.option("-v", "--verbose", count=True, help="Say more."),
        click.option("-q", "--quiet", is_flag=True, help="Say only what is wrong."),
        click.option("--debug", is_flag=True, help="Show the traceback of an error."),
        click.option("--strict", is_flag=True, help="Make warnings errors."),
        click.option("--no-plugins", is_flag=True, help="Leave out plugins of others."),
        click.option("--disable", multiple=True, metavar="NAME", help="Leave out one plugin."),
    )

    def decorate(function: Decorated) -> Decorated:
        for option in reversed(options):
            function = option(function)
        declared = getattr(function, "__click_params__", [])
        for parameter in declared[-len(options) :]:
            parameter.hidden = hidden
            parameter.expose_value = False
            parameter.callback = _remember
        return function

    return decorate


def _version(context: click.Context, parameter: click.Parameter, value: bool) -> None:
    del parameter
    if value and not context.resilient_parsing:
        from importlib.metadata import version

        click.echo(f"terrakit {version('terrakit')}")
        context.exit()


@click.group("terrakit", cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@global_options()
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_version,
    help="Show the version and exit.",
)
def terrakit() -> None:
    """Terrain from recipes: same recipe, same bytes.

    The options below may stand before or after a command.
    """
