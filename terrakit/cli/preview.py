"""``terrakit preview FILE [OUT.png]``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from terrakit.cli import options
from terrakit.cli.files import reader, writer
from terrakit.cli.messages import Settings, shown


@options.command("preview", cls=options.ImportingCommand)
@click.argument("source", metavar="FILE")
@click.argument("target", metavar="[OUT.png]", required=False)
@options.import_option
@options.export_option
@click.pass_obj
def command(
    settings: Settings,
    source: str,
    target: str | None,
    import_settings: dict[str, Any],
    export_settings: dict[str, Any],
) -> None:
    """Draw the terrain in FILE as a shaded picture, by default FILE.preview.png."""
    from terrakit.running import Run

    run = Run(device="numpy")
    read = reader(source, import_settings)
    default = f"{Path(source).name}.preview.png"
    write = writer(target or default, export_settings, "preview")
    written = write(read(run), run)
    if not settings.is_quiet:
        for path in written:
            click.echo(shown(path))
