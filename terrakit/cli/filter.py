"""``terrakit filter NAME IN OUT``."""

from __future__ import annotations

from terrakit.cli.operator_commands import OperatorGroup, input_and_output, work_on_file

command = OperatorGroup(
    "filter",
    "filter",
    work_on_file,
    input_and_output(source=True),
    "Reshape the terrain in IN and write it to OUT. See: terrakit filter NAME --help.",
)
