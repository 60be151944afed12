"""Options that several commands share, and how their values are read."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from typing import Any, TypeVar

import click

from terrakit.cli.commands import global_options

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

NUMBER = re.compile(r"[+-]?(\d[\d_]*)?\.?\d*([eE][+-]?\d+)?")
WHOLE_NUMBER = re.compile(r"[+-]?\d+")


def command(name: str, **settings: Any) -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator for a command that takes the global options too."""

    def decorate(function: Callable[..., Any]) -> click.Command:
        made: click.Command = click.command(name, **({"cls": click.Command} | settings))(
            global_options(hidden=True)(function)
        )
        return made

    return decorate


class ImportingCommand(click.Command):
    """A command that takes the parameters of whichever importer reads its file as options.

    Which importer that is shows only when the file is read, so an option that the command does
    not have, such as ``--spacing 30``, is taken for ``--in spacing=30``.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments, with unknown options as parameters of the importer."""
        known = {flag for p in self.get_params(ctx) for flag in (*p.opts, *p.secondary_opts)}
        collects = "--in" if "--in" in known else "--set"
        waiting, taken = list(args), []
        while waiting and waiting[0] != "--":
            flag, sign, value = (token := waiting.pop(0)).partition("=")
            if not flag.startswith("--") or flag in known:
                taken.append(token)
                if flag in known and not sign and waiting and not self._is_flag(ctx, flag):
                    taken.append(waiting.pop(0))
                continue
            if not sign:
                value = waiting.pop(0) if waiting and waiting[0][:2] != "--" else "true"
            taken += [collects, f"{flag[2:].replace('-', '_')}={value}"]
        return super().parse_args(ctx, taken + waiting)

    def _is_flag(self, ctx: click.Context, flag: str) -> bool:
        option = next(p for p in self.get_params(ctx) if flag in (*p.opts, *p.secondary_opts))
        return bool(getattr(option, "is_flag", False) or getattr(option, "count", False))


def toml_value(text: str) -> Any:
    """Return ``text`` read as a TOML value, or as it is where it is none."""
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return document["value"] if list(document) == ["value"] else text


def number(text: str) -> int | float | None:
    """Return the number that ``text`` is, or None."""
    try:
        return int(text) if WHOLE_NUMBER.fullmatch(text) else float(text)
    except ValueError:
        return None


class Assignment(click.ParamType):  # type: ignore[type-arg]
    """``KEY=VALUE``; the value is TOML, or text where it is no TOML."""

    name = "key=value"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, Any]:
        """Return the key and the value."""
        if isinstance(value, tuple):
            return value
        key, sign, text = value.partition("=")
        if not sign or not key.strip():
            self.fail(f"{value!r}: must be KEY=VALUE", param, ctx)
        return key.strip(), toml_value(text.strip())


class SeedType(click.ParamType):  # type: ignore[type-arg]
    """Any integer or text."""

    name = "seed"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """Return an integer where the text is one; refuse other numbers, which would surprise."""
        if isinstance(value, int):
            return value
        text: str = value.strip()
        found = number(text)
        if isinstance(found, int):
            return found
        if found is not None and any(c.isdigit() for c in text):
            self.fail(f"{value}: must be an integer or text", param, ctx)
        return text


def set_option(flag: str, help: str, name: str | None = None) -> Callable[[Decorated], Decorated]:
    """Return an option that collects ``KEY=VALUE`` pairs into a dict."""
    names = (flag,) if name is None else (flag, name)
    return click.option(
        *names,
        type=Assignment(),
        multiple=True,
        metavar="KEY=VALUE",
        callback=lambda context, parameter, value: dict(value),
        help=help,
    )


device_option = click.option(
    "--device",
    metavar="NAME",
    help="Part of a device's name, gpu, cpu or numpy; the best one by default.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Write JSON to stdout.")
recipe_set_option = set_option(
    "--set",
    "Change a recipe: --set thermal.talus_angle=30 or, in its header, --set samples=257. "
    "May be repeated.",
    "settings",
)
import_option = set_option(
    "--in", "A parameter of the importer, such as spacing=30. May be repeated.", "import_settings"
)
export_option = set_option(
    "--out", "A parameter of the exporter, such as up=y. May be repeated.", "export_settings"
)
seed_option = click.option("--seed", type=SeedType(), help="Any integer or text.")
max_cells_option = click.option(
    "--max-cells",
    type=click.IntRange(min=1),
    help="Most samples that may be asked for (default 2^28).",
)
