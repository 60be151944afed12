"""``terrakit validate RECIPE``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from terrakit.cli import options
from terrakit.cli.tables import write_json, write_table


@options.command("validate")
@click.argument("recipe", required=False)
@options.recipe_set_option
@click.option("--out", "out", metavar="DIR", help="Check this folder too; by default ./NAME.")
@options.max_cells_option
@click.option("--schema", is_flag=True, help="Write the JSON Schema of recipes and exit.")
@options.json_option
def command(
    recipe: str | None,
    settings: dict[str, Any],
    out: str | None,
    max_cells: int | None,
    schema: bool,
    as_json: bool,
) -> None:
    """Check RECIPE without running it: keys, values, order, memory, disk and output places."""
    if schema:
        from terrakit.schema import recipe_schema

        write_json(recipe_schema())
        return
    if recipe is None:
        raise click.UsageError("name a recipe, or ask for --schema")

    from terrakit.operators import Exporter
    from terrakit.pipeline import check_recipe, disk_needed, memory_of
    from terrakit.recipe import DEFAULT_MAX_CELLS, load_recipe

    loaded = load_recipe(recipe, settings)
    check_recipe(loaded, Path(loaded.name if out is None else out), max_cells or DEFAULT_MAX_CELLS)
    grid, grids = loaded.grid, loaded.grids()
    memory = {step.name: memory_of(step, grids) for step in loaded.steps}
    disk = {
        step.name: disk_needed([step], grids)
        for step in loaded.steps
        if isinstance(step.operator, Exporter) and grids[step.name] is not None
    }
    if as_json:
        write_json(
            {
                "recipe": loaded.to_dict(),
                "samples": list(grid.shape) if grid is not None else None,
                "spacing": grid.spacing if grid is not None else None,
                "memory": memory,
                "disk": disk,
            }
        )
        return
    write_table(
        ("step", "use", "memory", "disk"),
        [
            (
                step.name,
                step.use,
                _megabytes(memory[step.name]),
                _megabytes(disk[step.name]) if step.name in disk else "",
            )
            for step in loaded.steps
        ],
    )
    if grid is not None:
        known = [size for size in memory.values() if size is not None]
        peak, files = _megabytes(max(known)), _megabytes(sum(disk.values()))
        click.echo(
            f"{grid.shape[0]} x {grid.shape[1]} samples at {grid.spacing:g} m; "
            f"{peak} of memory, {files} of disk"
        )
    click.echo(f"{loaded.name}: valid")


def _megabytes(size: float | None) -> str:
    return "?" if size is None else f"{size / 1e6:.1f} MB"
