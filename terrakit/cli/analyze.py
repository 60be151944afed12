"""``terrakit analyze FILE``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from terrakit.cli import options
from terrakit.cli.files import reader
from terrakit.cli.interruption import INTERRUPTION
from terrakit.cli.messages import Settings, note
from terrakit.cli.progress import Reporter
from terrakit.cli.tables import write_json, write_table

if TYPE_CHECKING:
    from terrakit.operators import Surface


@options.command("analyze", cls=options.ImportingCommand)
@click.argument("source", metavar="FILE")
@options.set_option(
    "--set",
    "A parameter of the importer (spacing=30), or of the recipe's steps. May be repeated.",
    "settings",
)
@options.seed_option
@options.device_option
@options.json_option
@click.pass_obj
def command(
    settings_: Settings,
    source: str,
    settings: dict[str, Any],
    seed: int | str | None,
    device: str | None,
    as_json: bool,
) -> int:
    """Measure the terrain in FILE, or that a recipe makes, and compare it with real land.

    Ends with 0 whatever the verdict; with --strict a failed yardstick ends with 1.
    """
    from terrakit.api import analyze
    from terrakit.recipe import shipped

    if Path(source).suffix == ".toml" or (source in shipped() and not Path(source).is_file()):
        surface = _terrain_of_recipe(source, settings, seed, device, settings_)
    else:
        surface = _terrain_of_file(source, settings)
    analysis = analyze(surface)  # type: ignore[arg-type]  # it refuses meshes itself
    if as_json:
        write_json(analysis.to_dict())
    else:
        write_table(
            ("yardstick", "value", "verdict", "passes", "real land", "noise"),
            [
                (row.name, f"{row.value} {row.unit}", row.verdict, row.passes, row.real, row.noise)
                for row in analysis.table()
            ],
        )
        for reason in analysis.reasons.items():
            note("{}: {}".format(*reason))
        for line in analysis.notes:
            note(f"note: {line}")
        click.echo(f"verdict: {analysis.verdict}")
    return 1 if settings_.strict and analysis.verdict == "fail" else 0


def _terrain_of_file(source: str, settings: dict[str, Any]) -> Surface:
    from terrakit.running import Run

    run = Run(device="numpy")
    with INTERRUPTION.cancelling(run.cancel):
        return reader(source, settings)(run)


def _terrain_of_recipe(
    source: str,
    settings: dict[str, Any],
    seed: int | str | None,
    device: str | None,
    settings_: Settings,
) -> Surface:
    from terrakit.compute import choose_device
    from terrakit.pipeline import check_recipe, run_recipe
    from terrakit.recipe import load_recipe
    from terrakit.results import ResultCache
    from terrakit.running import Run

    recipe = load_recipe(source, settings)
    if seed is not None:
        recipe = recipe.with_seed(seed)
    check_recipe(recipe)
    reporter = Reporter(settings_)
    run = Run(recipe.header.seed, choose_device(device), reporter.update)
    with INTERRUPTION.cancelling(run.cancel), reporter.showing():
        result = run_recipe(
            recipe,
            run,
            cache=ResultCache(),
            on_step=lambda step, entry: reporter.done(step.name, entry["seconds"]),
        )
    return result.surface
