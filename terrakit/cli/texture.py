"""``terrakit texture NAME IN OUT``."""

from __future__ import annotations

from terrakit.cli.operator_commands import OperatorGroup, input_and_output, work_on_file

command = OperatorGroup(
    "texture",
    "texture",
    work_on_file,
    input_and_output(source=True),
    "Add a texture's layers to the terrain in IN and write it to OUT. "
    "See: terrakit texture NAME --help.",
)
