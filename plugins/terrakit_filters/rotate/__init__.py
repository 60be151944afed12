"""Turns a terrain about its middle."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import InputError
from terrakit.heightfield import Field, Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import parameter
from terrakit.running import Run
from terrakit_filters.sampling import F, Numbers, sampled, taken_along

BLOCK = 256
"""Rows that are turned at once, so that memory stays small."""


class Rotate(Filter):
    """Turn the terrain and all its layers about its middle, counter-clockwise seen from above.

    Quarter turns move samples and change none; four of them give back every bit. Any other angle
    takes heights by cubics (Catmull & Rom), layers linearly and numbered layers by the nearest
    sample::

        z'(p) = z(c + R(-angle) (p - c))

    ``edges`` says what becomes of corners that no ground reaches: ``crop`` keeps the largest
    upright rectangle that is covered, ``extend`` continues the nearest edge, ``level`` fills in
    ``edge_height``; the last two keep the grid.

    References
    ----------
    E. Catmull and R. Rom, "A class of local interpolating splines", 1974.
    """

    name = "rotate"
    cites = ("Catmull & Rom 1974",)
    fields = 8
    locality = "global"
    changes_grid = True
    turning: ClassVar = None
    trial: ClassVar = {"angle": 30.0}

    angle: float = parameter(
        90.0, "How far to turn, counter-clockwise seen from above.", unit="deg", ge=-360, le=360
    )
    edges: Literal["crop", "extend", "level"] = parameter(
        "crop", "What becomes of corners without ground: cut off, extended or filled level."
    )
    edge_height: float = parameter(
        0.0, "Height of those corners, for edges = level.", unit="m", ge=-1e6, le=1e6
    )

    def grid_after(self, grid: Grid) -> Grid:
        """Return the grid of the turned terrain, about the same middle."""
        rows, cols = grid.shape
        quarters, rest = divmod(self.angle % 360.0, 90.0)
        if rest == 0.0:
            shape = (cols, rows) if quarters % 2 else (rows, cols)
        elif self.edges != "crop":
            return grid
        else:
            shape = self._covered(grid)
        x, y = grid.north_west
        east, south = (cols - shape[1]) / 2, (rows - shape[0]) / 2
        origin = x + east * grid.spacing, y - south * grid.spacing
        return Grid(shape, grid.spacing, origin, grid.crs)

    def _covered(self, grid: Grid) -> tuple[int, int]:
        """Return rows and columns of the largest upright rectangle in the turned one."""
        height, width = (n - 1.0 for n in grid.shape)
        turn = math.radians(self.angle % 180.0)
        sine, cosine = abs(math.sin(turn)), abs(math.cos(turn))
        long, short = max(width, height), min(width, height)
        if short <= 2.0 * sine * cosine * long or abs(sine - cosine) < 1e-10:
            # Two corners lie on the long sides: the other two are free
            half = 0.5 * short
            wide, high = (half / sine, half / cosine)
            if width < height:
                wide, high = high, wide
        else:
            both = cosine * cosine - sine * sine
            wide = (width * cosine - height * sine) / both
            high = (height * cosine - width * sine) / both
        shape = math.floor(high + 1e-9) + 1, math.floor(wide + 1e-9) + 1
        if min(shape) < 2:
            raise InputError(
                f"angle = {self.angle:g}: of {grid.shape[0]}x{grid.shape[1]} samples nothing "
                'upright is left; set edges = "extend"'
            )
        return shape

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the turned terrain."""
        grid = self.grid_after(surface.grid)
        quarters, rest = divmod(self.angle % 360.0, 90.0)
        if rest == 0.0:
            return taken_along(surface, grid, lambda field, _: np.rot90(field, int(quarters)))
        return taken_along(
            surface, grid, lambda field, way: self._turned(field, way, grid.shape, run)
        )

    def _turned(self, field: Field, way: str, shape: tuple[int, int], run: Run) -> Field:
        turn = math.radians(self.angle)
        cosine, sine = math.cos(turn), math.sin(turn)
        east = (np.arange(shape[1]) - 0.5 * (shape[1] - 1))[None, :]
        result = np.empty(shape, dtype=F)
        for first in range(0, shape[0], BLOCK):
            run.check()
            rows = np.arange(first, min(first + BLOCK, shape[0]))
            north = (0.5 * (shape[0] - 1) - rows)[:, None]
            col = 0.5 * (field.shape[1] - 1) + (cosine * east + sine * north)
            row = 0.5 * (field.shape[0] - 1) - (cosine * north - sine * east)
            part = sampled(field, row, col, way)
            if self.edges == "level":
                part = np.where(_outside(row, col, field.shape), self._level(way), part)
            result[rows] = part
        return result

    def _level(self, way: str) -> np.float32:
        """Return what fills the corners: the height; layers, among them ``valid``, get 0."""
        return F(self.edge_height) if way == "cubic" else F(0)


def _outside(row: Numbers, col: Numbers, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which places lie beyond the outermost samples, but for rounding."""
    slack = 1e-6
    return (
        (row < -slack)
        | (col < -slack)
        | (row > shape[0] - 1 + slack)
        | (col > shape[1] - 1 + slack)
    )
