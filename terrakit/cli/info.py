"""``terrakit info FILE``."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import click

from terrakit.cli import options
from terrakit.cli.files import reader
from terrakit.cli.messages import one_line, shown
from terrakit.cli.tables import write_json

if TYPE_CHECKING:
    from terrakit.operators import Surface


@options.command("info", cls=options.ImportingCommand)
@click.argument("file")
@options.import_option
@options.json_option
def command(file: str, import_settings: dict[str, Any], as_json: bool) -> None:
    """Say what is in a terrain file: size, spacing, extent, heights, layers, problems."""
    from terrakit.running import Run

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        surface = reader(file, import_settings)(Run(device="numpy"))
    facts = describe_surface(surface)
    facts["problems"] = list(dict.fromkeys(one_line(str(w.message)) for w in caught))
    if as_json:
        write_json({"file": shown(file), **facts})
        return
    click.echo(shown(file))
    for key, value in facts.items():
        click.echo(f"  {key:<10} {_text(value)}")


def describe_surface(surface: Surface) -> dict[str, Any]:
    """Return the facts about a surface, as JSON can hold them."""
    from terrakit.heightfield import Heightfield

    if isinstance(surface, Heightfield):
        rows, cols = surface.shape
        west, north = surface.origin
        width, depth = surface.grid.size
        low, high = float(surface.elevation.min()), float(surface.elevation.max())
        return {
            "kind": "heightfield",
            "rows": rows,
            "columns": cols,
            "spacing": surface.spacing,
            "extent": {
                "west": west,
                "east": west + width,
                "south": north - depth,
                "north": north,
            },
            "elevation": {"lowest": low, "highest": high},
            "crs": surface.crs,
            "layers": list(surface),
        }
    corners = surface.vertices.min(axis=0).tolist(), surface.vertices.max(axis=0).tolist()
    return {
        "kind": "mesh",
        "vertices": len(surface.vertices),
        "faces": len(surface.faces),
        "lowest": corners[0],
        "highest": corners[1],
        "layers": list(surface.layers),
    }


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(part)}" for key, part in value.items())
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, float):
        return f"{value:.10g}"
    return "none" if value is None else str(value)
