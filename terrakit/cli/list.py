"""``terrakit list``."""

from __future__ import annotations

import click

from terrakit.cli import options
from terrakit.cli.tables import write_json, write_table

KINDS = ("generator", "filter", "erosion", "texture", "importer", "exporter", "recipe")


@options.command("list")
@click.argument("kind", required=False, type=click.Choice(KINDS))
@options.json_option
def command(kind: str | None, as_json: bool) -> None:
    """List operators by kind, and the recipes that come with terrakit."""
    from terrakit.recipe import shipped_titles
    from terrakit.registry import default_registry

    registry = default_registry()
    entries = [
        {
            "kind": operator.kind,
            "name": operator.name,
            "summary": operator.summary(),
            "plugin": registry.owner(operator).label,
        }
        for operator in registry.operators()
    ]
    entries += [
        {"kind": "recipe", "name": name, "summary": title, "plugin": ""}
        for name, title in shipped_titles().items()
    ]
    entries = [entry for entry in entries if kind in (None, entry["kind"])]
    if as_json:
        write_json(entries)
        return
    write_table(
        ("kind", "name", "summary"),
        [(entry["kind"], entry["name"], entry["summary"]) for entry in entries],
    )
