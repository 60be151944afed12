"""Refinement by measured innovations in NumPy: the oracle of ``amplify.cl``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact

F = np.float32
Heights = NDArray[np.float32]
MARGIN = 6
"""Samples before the terrain's first one; after its last one there is one fewer."""


@dataclass(frozen=True)
class Level:
    """What one doubling of the samples needs besides the heights.

    Parameters
    ----------
    strength
        Share of the deviation at the terrain's samples, with the margin.
    still
        1 for cells of the terrain that stay as they are, with the margin.
    seed
        Two words.
    centre, edge
        Standard deviation of the innovations of centres and of edges, metres.
    north_west
        World index, in the finer samples, of the terrain's first one.
    level
        How often the terrain was doubled before.
    is_mean
        Whether to guess from the four nearest points alone.
    """

    strength: Heights
    still: NDArray[np.uint8]
    seed: tuple[int, int]
    centre: float
    edge: float
    north_west: tuple[int, int]
    level: int
    is_mean: bool

    def guess(self, base: Heights, near: Heights, further: Heights, far: Heights) -> Heights:
        """Return the height that the points around tell; sums are of heights above ``base``."""
        if self.is_mean:
            mean: Heights = base + F(0.25) * near
            return mean
        guess: Heights = base + (
            (F(0.3359375) * near - F(0.0546875) * further) + F(0.0234375) * far
        )
        return guess

    def innovation(
        self, deviation: float, row: NDArray[np.int64], col: NDArray[np.int64]
    ) -> Heights:
        """Return random heights at finer samples, counted from the terrain's first one."""
        finer = self.level + 1
        part = F(1) / F(1 << finer)
        top, left = (row >> finer) + MARGIN, (col >> finer) + MARGIN
        y, x = ((at & ((1 << finer) - 1)).astype(F) * part for at in (row, col))
        s = self.strength
        north = s[top, left] + x * (s[top, left + 1] - s[top, left])
        south = s[top + 1, left] + x * (s[top + 1, left + 1] - s[top + 1, left])
        share = north + y * (south - north)
        place = (
            ((at + first) & 0xFFFFFFFF).astype(np.uint32)
            for at, first in zip((col, row), reversed(self.north_west), strict=True)
        )
        height: Heights = share * (F(deviation) * exact.normal(exact.hashed(self.seed, *place)))
        return height

    def stays(self, row: NDArray[np.int64], col: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether cells of this level lie in a cell of the terrain that stays as it is."""
        found = self.still[(row >> self.level) + MARGIN, (col >> self.level) + MARGIN]
        result: NDArray[np.bool_] = found != 0
        return result


def doubled(height: Heights, level: Level) -> Heights:
    """Return heights with a margin at half the spacing; every second one is as it was."""
    rows, cols = (n - 2 * MARGIN + 6 for n in height.shape)
    row = np.arange(rows, dtype=np.int64)[:, None] + 3 - MARGIN
    col = np.arange(cols, dtype=np.int64)[None, :] + 3 - MARGIN
    middle = _centres(height, level)

    def at(south: int, east: int) -> Heights:
        return height[3 + south : 3 + south + rows, 3 + east : 3 + east + cols]

    def centre(south: int, east: int) -> Heights:
        return middle[2 + south : 2 + south + rows, 2 + east : 2 + east + cols]

    here = level.stays(row, col)
    fine = np.empty((2 * rows, 2 * cols), dtype=F)
    fine[::2, ::2] = at(0, 0)
    fine[1::2, 1::2] = centre(0, 0)
    for down, across in ((0, 1), (1, 0)):
        base = at(0, 0)
        end = at(down, across) - base
        near = end + ((centre(-across, -down) - base) + (centre(0, 0) - base))
        further = (
            ((at(-across, -down) - base) + (at(down - across, across - down) - base))
            + ((at(across, down) - base) + (at(1, 1) - base))
            + (
                (
                    (centre(-across - down, -down - across) - base)
                    + (centre(-across + down, -down + across) - base)
                )
                + ((centre(-down, -across) - base) + (centre(down, across) - base))
            )
        )
        far = ((at(-down, -across) - base) + (at(2 * down, 2 * across) - base)) + (
            (centre(-2 * across, -2 * down) - base) + (centre(across, down) - base)
        )
        random = level.innovation(level.edge, 2 * row + down, 2 * col + across)
        stays = here | level.stays(row - across, col - down)
        fine[down::2, across::2] = np.where(
            stays, base + F(0.5) * end, level.guess(base, near, further, far) + random
        )
    return fine


def _centres(height: Heights, level: Level) -> Heights:
    """Return the centres of the cells from 1, 1 on."""
    rows, cols = (n - 3 for n in height.shape)
    row = np.arange(rows, dtype=np.int64)[:, None] + 1 - MARGIN
    col = np.arange(cols, dtype=np.int64)[None, :] + 1 - MARGIN
    base = height[1 : 1 + rows, 1 : 1 + cols]

    def above(south: int, east: int) -> Heights:
        return height[1 + south : 1 + south + rows, 1 + east : 1 + east + cols] - base

    near = above(0, 1) + above(1, 0) + above(1, 1)
    further = (
        (above(-1, 0) + above(-1, 1))
        + (above(2, 0) + above(2, 1))
        + ((above(0, -1) + above(1, -1)) + (above(0, 2) + above(1, 2)))
    )
    far = (above(-1, -1) + above(2, 2)) + (above(-1, 2) + above(2, -1))
    random = level.innovation(level.centre, 2 * row + 1, 2 * col + 1)
    lively = level.guess(base, near, further, far) + random
    return np.where(level.stays(row, col), base + F(0.25) * near, lively)
