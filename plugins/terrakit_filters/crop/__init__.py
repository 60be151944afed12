"""Cuts a piece out of a terrain."""

from __future__ import annotations

import math
from typing import ClassVar

from pydantic import field_validator

from terrakit.errors import InputError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_filters.sampling import taken_along


class Crop(Filter):
    """Keep the part of the terrain within bounds in world coordinates.

    The bounds move to the nearest samples, and every sample keeps its values and its place in the
    world. What the bounds reach beyond the terrain is left out.
    """

    name = "crop"
    locality = "global"
    changes_grid = True
    turning: ClassVar = None
    trial: ClassVar = {"bounds": [20.0, 30.0, 5000.0, 4000.0]}

    bounds: list[float] = parameter(
        ..., "West, south, east and north side in world coordinates.", unit="m"
    )

    @field_validator("bounds")
    @classmethod
    def _four_sides(cls, bounds: list[float]) -> list[float]:
        if len(bounds) != 4 or not (bounds[0] < bounds[2] and bounds[1] < bounds[3]):
            raise ValueError("must be [west, south, east, north] with west < east, south < north")
        return bounds

    def grid_after(self, grid: Grid) -> Grid:
        """Return the part of the grid within the bounds."""
        rows, cols = self._window(grid)
        x, y = grid.north_west
        shape = rows.stop - rows.start, cols.stop - cols.start
        origin = x + cols.start * grid.spacing, y - rows.start * grid.spacing
        return Grid(shape, grid.spacing, origin, grid.crs)

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the part within the bounds."""
        del run
        window = self._window(surface.grid)
        return taken_along(surface, self.grid_after(surface.grid), lambda field, _: field[window])

    def _window(self, grid: Grid) -> tuple[slice, slice]:
        west, south, east, north = self.bounds
        x, y = grid.north_west
        cols = _between((west - x) / grid.spacing, (east - x) / grid.spacing, grid.shape[1])
        rows = _between((y - north) / grid.spacing, (y - south) / grid.spacing, grid.shape[0])
        if cols is None or rows is None:
            width, height = grid.size
            raise InputError(
                f"bounds = {self.bounds}: hold less than 2x2 samples of the terrain, which spans "
                f"{x:g} to {x + width:g} m east and {y - height:g} to {y:g} m north, "
                f"{grid.spacing:g} m apart; move or widen the bounds"
            )
        return rows, cols


def _between(first: float, last: float, count: int) -> slice | None:
    """Return the samples nearest to two places and those between; None where they are too few."""
    begin = max(0, math.floor(min(max(first, -1.0), count + 1.0) + 0.5))
    end = min(count - 1, math.floor(min(max(last, -1.0), count + 1.0) + 0.5))
    return slice(begin, end + 1) if end > begin else None
