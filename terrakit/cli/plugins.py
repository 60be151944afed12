"""``terrakit plugins``."""

from __future__ import annotations

import warnings

from terrakit.cli import options
from terrakit.cli.messages import one_line
from terrakit.cli.tables import write_json, write_table


@options.command("plugins")
@options.json_option
def command(as_json: bool) -> None:
    """List plugins with what they bring, broken ones included."""
    from terrakit.registry import default_registry

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the table says it
        plugins = default_registry().plugins()
    if as_json:
        write_json(
            [
                {
                    "distribution": plugin.distribution,
                    "version": plugin.version,
                    "entry_point": plugin.name,
                    "module": plugin.module,
                    "state": "broken" if plugin.problem else "works",
                    "problem": one_line(plugin.problem),
                    "operators": [operator.name for operator in plugin.operators],
                }
                for plugin in plugins
            ]
        )
        return
    write_table(
        ("plugin", "entry point", "state", "brings"),
        [
            (
                plugin.label,
                plugin.name,
                "broken" if plugin.problem else "works",
                one_line(plugin.problem) or ", ".join(o.name for o in plugin.operators),
            )
            for plugin in plugins
        ],
    )
