"""``terrakit run RECIPE``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from terrakit.cli import options
from terrakit.cli.interruption import INTERRUPTION
from terrakit.cli.messages import Settings, shown
from terrakit.cli.progress import Reporter
from terrakit.cli.tables import write_json


@options.command("run")
@click.argument("recipe")
@options.recipe_set_option
@options.seed_option
@click.option("--out", "out", metavar="DIR", help="Folder for the files; by default ./NAME.")
@options.device_option
@click.option("--no-cache", is_flag=True, help="Compute every step anew and keep nothing.")
@options.max_cells_option
@options.json_option
@click.pass_obj
def command(
    settings_: Settings,
    recipe: str,
    settings: dict[str, Any],
    seed: int | str | None,
    out: str | None,
    device: str | None,
    no_cache: bool,
    max_cells: int | None,
    as_json: bool,
) -> None:
    """Run RECIPE: the name of a shipped recipe or the path of a .toml file.

    The files, a picture and run.json, the record of how they came to be, go to ./NAME or --out.
    """
    from terrakit.compute import choose_device
    from terrakit.pipeline import check_recipe, run_recipe
    from terrakit.recipe import DEFAULT_MAX_CELLS, Step, load_recipe
    from terrakit.results import ResultCache
    from terrakit.running import Run

    loaded = load_recipe(recipe, settings)
    if seed is not None:
        loaded = loaded.with_seed(seed)
    folder = Path(loaded.name if out is None else out)
    limit = max_cells or DEFAULT_MAX_CELLS
    check_recipe(loaded, folder, limit)
    reporter = Reporter(settings_)
    chosen = choose_device(device)
    reporter.say(f"device  {chosen.label}")
    if "seed" not in loaded.header.model_fields_set and seed is None:
        reporter.say(f"seed  {loaded.header.seed}  (the recipe names none)")
    run = Run(loaded.header.seed, chosen, reporter.update)

    def on_step(step: Step, entry: dict[str, Any]) -> None:
        remark = "from the cache" if entry.get("cached") else ""
        reporter.done(step.name, entry["seconds"], remark)
        if settings_.verbosity > 0:
            for store, account in entry.get("ledger", {}).items():
                moved, missing = account["moved"], account["residual"]
                reporter.say(f"  {store}: {moved:.6g} m3 moved, {missing:.3g} m3 unaccounted for")

    with INTERRUPTION.cancelling(run.cancel), reporter.showing():
        result = run_recipe(
            loaded,
            run,
            folder,
            cache=None if no_cache else ResultCache(),
            max_cells=limit,
            on_step=on_step,
        )
    if as_json:
        write_json({**result.report, "files": [shown(path) for path in result.files]})
    elif not settings_.is_quiet:
        for path in result.files:
            click.echo(shown(path))
