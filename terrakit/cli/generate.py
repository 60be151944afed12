"""``terrakit generate NAME OUT``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from terrakit.cli import options
from terrakit.cli.operator_commands import OperatorGroup, finish, input_and_output

if TYPE_CHECKING:
    from terrakit.operators import Operator
    from terrakit.running import Run

SAMPLES, SPACING = 513, 10.0
"""What is made when nothing is said about resolution."""


class Pair(click.ParamType):  # type: ignore[type-arg]
    """One number, or two: west-east and south-north, as ``4000x2000``."""

    name = "number[xnumber]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return a number or a list of two."""
        parts = [options.number(part) for part in str(value).lower().split("x")]
        if None in parts or len(parts) > 2:
            self.fail(f"{value!r}: must be one number, or two as 4000x2000", param, ctx)
        return parts[0] if len(parts) == 1 else parts


def _work(
    context: click.Context,
    operator: Operator,
    target: str,
    export_settings: Mapping[str, Any],
    seed: int | str | None,
    device: str | None,
    size: Any,
    samples: Any,
    spacing: float | None,
    origin: Any,
    max_cells: int | None,
) -> None:
    from terrakit.cli.files import named_files, writer
    from terrakit.execute import check_memory, execute
    from terrakit.operators import Generator
    from terrakit.recipe import DEFAULT_MAX_CELLS, check_cells, grid_of, header_of

    assert isinstance(operator, Generator)
    if size is None and spacing is None and operator.portrait is not None:
        if isinstance(samples, list):
            spacing = operator.portrait / (max(2, *samples) - 1)
        else:
            size = operator.portrait
    header: dict[str, Any] = {"size": size, "samples": samples, "spacing": spacing}
    given = {key: value for key, value in header.items() if value is not None}
    if "samples" not in given and len(given) < 2:
        given["samples"] = SAMPLES
    if len(given) < 2:
        given["spacing"] = SPACING
    if origin is not None:
        given["origin"] = origin
    grid = grid_of(header_of(given, operator.name))
    assert grid is not None
    check_cells(grid, max_cells or DEFAULT_MAX_CELLS)
    check_memory(operator, grid.shape[0] * grid.shape[1])
    read_named, write = named_files(operator), writer(target, dict(export_settings))

    def make(run: Run) -> Any:
        run.earlier = read_named(run)
        return execute(operator, grid, run)

    finish(context, operator, seed, device, write, make)


command = OperatorGroup(
    "generate",
    "generator",
    _work,
    [
        *input_and_output(source=False),
        click.option(
            "--size",
            type=Pair(),
            help="Extent in metres, such as 4000 or 4000x2000 [what suits NAME].",
        ),
        click.option(
            "--samples", type=Pair(), help=f"Samples a side, such as 257 or 257x129 [{SAMPLES}]."
        ),
        click.option(
            "--spacing", type=float, help=f"Metres between samples [{SPACING:g}, or from the size]."
        ),
        click.option("--origin", type=Pair(), help="World x and y of the south-west corner."),
        options.max_cells_option,
    ],
    "Make a terrain and write it to OUT. See: terrakit generate NAME --help.",
)
