"""``terrakit erode NAME IN OUT``."""

from __future__ import annotations

from terrakit.cli.operator_commands import OperatorGroup, input_and_output, work_on_file

command = OperatorGroup(
    "erode",
    "erosion",
    work_on_file,
    input_and_output(source=True),
    "Erode the terrain in IN and write it to OUT. See: terrakit erode NAME --help.",
)
