"""``terrakit convert IN OUT``."""

from __future__ import annotations

from typing import Any

import click

from terrakit.cli import options
from terrakit.cli.files import reader, writer
from terrakit.cli.interruption import INTERRUPTION
from terrakit.cli.messages import Settings, shown
from terrakit.cli.progress import Reporter


@options.command("convert", cls=options.ImportingCommand)
@click.argument("source", metavar="IN")
@click.argument("target", metavar="OUT")
@options.import_option
@options.export_option
@click.pass_obj
def command(
    settings: Settings,
    source: str,
    target: str,
    import_settings: dict[str, Any],
    export_settings: dict[str, Any],
) -> None:
    """Read the terrain in IN and write it to OUT.

    The content of IN decides how it is read, the extension of OUT how it is written.
    """
    from terrakit.running import Run

    reporter = Reporter(settings)
    run = Run(device="numpy", on_progress=reporter.update)
    read, write = reader(source, import_settings), writer(target, export_settings)
    with INTERRUPTION.cancelling(run.cancel), reporter.showing():
        written = write(read(run), run)
    if not settings.is_quiet:
        for path in written:
            click.echo(shown(path))
