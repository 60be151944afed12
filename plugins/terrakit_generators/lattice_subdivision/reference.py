"""Lattice subdivision in NumPy: the readable definition, and the oracle of the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact

F = np.float32
Heights = NDArray[np.float32]


@dataclass(frozen=True)
class Noise:
    """Random heights of one level.

    Parameters
    ----------
    seeds
        Two words for the first half-step and two for the second.
    first, second
        Standard deviation of the random heights of each half-step, metres.
    is_uniform
        Whether they are uniform instead of nearly normal.
    additions
        Whether points that are already there are displaced too.
    """

    seeds: tuple[int, int, int, int]
    first: float
    second: float
    is_uniform: bool
    additions: bool

    def one(self, col: NDArray[np.uint32], row: NDArray[np.uint32]) -> Heights:
        """Return the first half-step's heights at world indices."""
        return F(self.first) * random(self.seeds[:2], col, row, self.is_uniform)

    def two(self, col: NDArray[np.uint32], row: NDArray[np.uint32]) -> Heights:
        """Return the second half-step's heights at world indices."""
        return F(self.second) * random(self.seeds[2:], col, row, self.is_uniform)


def random(
    seed: tuple[int, ...], col: NDArray[np.uint32], row: NDArray[np.uint32], is_uniform: bool
) -> Heights:
    """Return a number of mean 0 and deviation 1 for each point of a lattice."""
    hashes = exact.hashed((seed[0], seed[1]), col, row)
    if is_uniform:
        return (exact.uniform(hashes) - F(0.5)) * F(3.4641016)
    return exact.normal(hashes)


def indices(first: int, count: int, step: int = 1) -> NDArray[np.uint32]:
    """Return world indices as the kernels see them: their low 32 bits."""
    return ((first + step * np.arange(count, dtype=np.int64)) & 0xFFFFFFFF).astype(np.uint32)


def scatter(
    seed: tuple[int, int],
    height: float,
    is_uniform: bool,
    north_west: tuple[int, int],
    shape: tuple[int, int],
) -> Heights:
    """Return the random heights of the coarsest lattice."""
    row, col = (indices(f, n) for f, n in zip(north_west, shape, strict=True))
    return F(height) * random(seed, col[None, :], row[:, None], is_uniform)


def refine(
    rule: str,
    coarse: Heights,
    noise: Noise,
    north_west: tuple[int, int],
    inset: tuple[int, int],
    shape: tuple[int, int],
) -> Heights:
    """Return a lattice of half the spacing.

    Parameters
    ----------
    rule
        ``diamond_square``, ``midpoint`` or ``square_square``.
    coarse
        Heights of the coarser lattice.
    noise
        Random heights of this level.
    north_west
        World index, in the finer lattice, of the first point made.
    inset
        Row and column of the coarse point that it belongs to.
    shape
        How many coarse points get four points each.
    """
    row = indices(north_west[0], shape[0], 2)[:, None]
    col = indices(north_west[1], shape[1], 2)[None, :]

    def at(south: int, east: int) -> Heights:
        """Return the coarse points that lie so many steps from those that are refined."""
        top, left = inset[0] + south, inset[1] + east
        return coarse[top : top + shape[0], left : left + shape[1]]

    fine = np.empty((2 * shape[0], 2 * shape[1]), dtype=F)
    if rule == "square_square":
        four = [[at(south, east) for east in (0, 1)] for south in (0, 1)]
        for south in (0, 1):
            for east in (0, 1):
                near, far = four[south][east], four[1 - south][1 - east]
                beside, below = four[south][1 - east], four[1 - south][east]
                mean = (F(9) * near + F(3) * (beside + below) + far) * F(0.0625)
                place = col + np.uint32(east), row + np.uint32(south)
                fine[south::2, east::2] = mean + noise.one(*place)
        return fine

    def centre(south: int, east: int) -> Heights:
        """Return the centres south-east of the coarse points that lie so many steps away."""
        total = (at(south, east) + at(south + 1, east + 1)) + (
            at(south, east + 1) + at(south + 1, east)
        )
        place = col + np.uint32((2 * east + 1) % 2**32), row + np.uint32((2 * south + 1) % 2**32)
        return total * F(0.25) + noise.one(*place)

    def corner(south: int, east: int) -> Heights:
        if not noise.additions:
            return at(south, east)
        return at(south, east) + noise.one(col + np.uint32(2 * east), row + np.uint32(2 * south))

    one = np.uint32(1)
    if rule == "midpoint":
        here, middle = at(0, 0), centre(0, 0)
        across = (here + at(0, 1)) * F(0.5)
        down = (here + at(1, 0)) * F(0.5)
    else:
        here, middle = corner(0, 0), centre(0, 0)
        across = ((here + corner(0, 1)) + (centre(-1, 0) + middle)) * F(0.25)
        down = ((here + corner(1, 0)) + (centre(0, -1) + middle)) * F(0.25)
    if noise.additions:
        here = here + noise.two(col, row)
        if rule == "diamond_square":
            middle = middle + noise.two(col + one, row + one)
    fine[::2, ::2] = here
    fine[::2, 1::2] = across + noise.two(col + one, row)
    fine[1::2, ::2] = down + noise.two(col, row + one)
    fine[1::2, 1::2] = middle
    return fine


def sample(
    lattice: Heights,
    col_at: NDArray[np.int32],
    across: NDArray[np.float32],
    row_at: NDArray[np.int32],
    down: NDArray[np.float32],
    offset: float,
) -> Heights:
    """Return heights between the points of a lattice; arguments as in the kernel."""

    def between(south: int) -> Heights:
        a, b, c, d = (lattice[(row_at + south)[:, None], (col_at + k)[None, :]] for k in range(4))
        mixed: Heights = (across[0] * a + across[1] * b) + (across[2] * c + across[3] * d)
        return mixed

    v = down[:, :, None]
    north = v[0] * between(0) + v[1] * between(1)
    south = v[2] * between(2) + v[3] * between(3)
    result: Heights = F(offset) + (north + south)
    return result
