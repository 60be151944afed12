"""Where the samples of a grid lie in the world: the same numbers in a tile as in the whole.

A coordinate that is summed up from a tile's own origin differs in its last bits from the one of
the whole map. Here positions are whole parts of a sample, counted from the world's origin, so a
sample has one position whatever map it is in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Grid

FINE = 2**20
"""Parts of a sample to which positions are rounded."""


def parts(along: float, spacing: float) -> int:
    """Return a world coordinate in parts of a sample, of which a sample has :data:`FINE`."""
    return round(along / spacing * FINE)


def sample_axes(grid: Grid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return world x of every column and world y of every row, metres."""
    rows, cols = grid.shape
    x, y = (parts(along, grid.spacing) for along in grid.north_west)
    part = np.float64(grid.spacing / FINE)
    east: NDArray[np.float64] = (x + np.arange(cols) * FINE) * part
    north: NDArray[np.float64] = (y - np.arange(rows) * FINE) * part
    return east, north


def is_part(grid: Grid, world: Grid | None) -> bool:
    """Return whether a terrain is only a part of the world, where much may well be missing."""
    return world is not None and any(
        side < 0.999 * whole for side, whole in zip(grid.size, world.size, strict=True)
    )
