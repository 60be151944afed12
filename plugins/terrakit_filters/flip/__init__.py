"""Mirrors a terrain."""

from __future__ import annotations

from typing import ClassVar, Literal

from terrakit.heightfield import Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_filters.sampling import taken_along


class Flip(Filter):
    """Mirror the terrain and all its layers, sample by sample.

    The terrain stays where it is in the world; what was in the west of it comes to lie in the east
    (``east_west``), or what was in the north in the south (``north_south``)::

        z'(row, col) = z(row, cols - 1 - col)    or    z(rows - 1 - row, col)
    """

    name = "flip"
    locality = "global"
    changes_grid = True
    turning: ClassVar = None

    across: Literal["east_west", "north_south"] = parameter(
        "east_west", "Which two sides change places."
    )

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the mirrored terrain."""
        del run
        axis = 1 if self.across == "east_west" else 0
        order = (slice(None), slice(None, None, -1)) if axis else (slice(None, None, -1),)
        return taken_along(surface, surface.grid, lambda field, _: field[order])
