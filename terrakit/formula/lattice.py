"""Where noise lives: lattices in the world, one an octave, in 64-bit fixed point.

A sample's position on a lattice is an integer, a whole number of 2**-32 of a lattice cell, from
the sample's world index. So a tile far from the origin is as sharp as one at it, and equals the
same part of a larger map bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from terrakit.errors import ParameterError
from terrakit.heightfield import Grid
from terrakit.running import seed_words
from terrakit.world import FINE, parts

ONE = 2**32
"""One lattice cell in the fixed point of lattice positions."""
SKEW = (math.sqrt(3.0) - 1.0) / 2.0
"""How simplex noise stretches its square lattice along the diagonal into triangles."""
TURNS = ((0.8, 0.6), (5 / 13, 12 / 13), (-8 / 17, 15 / 17), (21 / 29, -20 / 29), (1.0, 0.0))
"""Cosine and sine of each octave's turn: rational, so that no library decides their bits.

The first is turned too, or the largest hills would lie along the rows and columns of the grid.
"""

STRAIGHT = (1.0, 0.0)
FINEST = 2**20
"""Lattice cells a sample beyond which noise is refused."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """The lattices of one noise, an octave each.

    Parameters
    ----------
    basis
        Name of the noise basis.
    eastward
        Of shape (octaves, 2, cols): what each column adds to u and v, in parts of a cell.
    northward
        Of shape (octaves, 2, rows): what each row adds.
    metres
        Four numbers an octave: what u and v gain by a metre east and by a metre north.
    turns
        Cosine and sine of each octave's turn.
    seeds
        Two 32-bit words an octave.
    """

    basis: str
    eastward: NDArray[np.int64]
    northward: NDArray[np.int64]
    metres: NDArray[np.float32]
    turns: NDArray[np.float32]
    seeds: NDArray[np.uint32]

    @property
    def octaves(self) -> int:
        """How many octaves there are."""
        return len(self.seeds)


def world_lattice(
    grid: Grid,
    basis: str,
    skewed: bool,
    wavelengths: list[float],
    words: tuple[int, int],
    turned: bool = True,
) -> Lattice:
    """Return lattices with cells of these sizes, fixed in the world.

    Parameters
    ----------
    grid
        Where the samples lie.
    basis
        Name of the noise basis.
    skewed
        Whether the basis wants the lattice of simplex noise.
    wavelengths
        Side of a cell of each octave, metres.
    words
        Seed, as two 32-bit words; each octave is shifted by its own hash of it.
    turned
        Whether octaves are turned against each other.

    Raises
    ------
    ParameterError
        If an octave is far below the spacing of the samples.
    """
    x, y = (parts(along, grid.spacing) for along in grid.north_west)
    rows, cols = grid.shape
    eastward, northward, metres, turns, seeds = [], [], [], [], []
    for octave, wavelength in enumerate(wavelengths):
        if grid.spacing / wavelength >= FINEST:
            raise ParameterError(_too_fine(wavelengths, octave, grid.spacing))
        cosine, sine = TURNS[octave % len(TURNS)] if turned else STRAIGHT
        matrix = _skewed(cosine, sine) if skewed else (cosine, -sine, sine, cosine)
        shift = seed_words(*words, "shift", octave)
        cell = Fraction(grid.spacing) / Fraction(wavelength)
        steps = [round(Fraction(part) * cell * ONE * ONE) for part in matrix]
        eastward.append([_along(x, cols, 1, steps[2 * v], shift[v] << 16) for v in (0, 1)])
        northward.append([_along(y, rows, -1, steps[2 * v + 1], 0) for v in (0, 1)])
        metres.append([part / wavelength for part in matrix])
        turns.append((cosine, sine))
        seeds.append(seed_words(*words, octave))
    return Lattice(
        basis,
        np.array(eastward, dtype=np.int64),
        np.array(northward, dtype=np.int64),
        np.array(metres, dtype=np.float32),
        np.array(turns, dtype=np.float32),
        np.array(seeds, dtype=np.uint32),
    )


def free_lattice(
    basis: str, skewed: bool, words: tuple[int, int], shape: tuple[int, int]
) -> Lattice:
    """Return a lattice whose positions are given in cells, by formulas alone."""
    rows, cols = shape
    shift = seed_words(*words, "shift", 0)
    matrix = _skewed(1.0, 0.0) if skewed else (1.0, 0.0, 0.0, 1.0)
    return Lattice(
        basis,
        np.array([[np.full(cols, word << 16, np.int64) for word in shift]]),
        np.zeros((1, 2, rows), np.int64),
        np.array([matrix], dtype=np.float32),
        np.array([STRAIGHT], dtype=np.float32),
        np.array([seed_words(*words, 0)], dtype=np.uint32),
    )


def _along(first: int, count: int, direction: int, step: int, shift: int) -> NDArray[np.int64]:
    """Return where samples lie along an axis of a lattice, in parts of a cell.

    Each is rounded down from its exact place, so that it does not depend on the tile, nor, to a
    part, on the spacing, however far from the origin it is.

    Parameters
    ----------
    first
        Place of the first sample, in parts of a sample.
    count
        How many there are.
    direction
        1 where places rise with the index, else -1.
    step
        What a whole sample adds, in parts of a part: 2**-64 of a cell.
    shift
        Where the lattice begins, in parts of a cell.
    """
    whole, rest = divmod(first, FINE)
    remainder = rest * step // FINE + shift * ONE
    if abs(whole) + count >= 2**30:  # beyond what 64 bits hold below
        exact = [(whole + direction * n) * step + remainder >> 32 for n in range(count)]
        return np.array([_wrapped(place) for place in exact], dtype=np.int64)
    (high, low), (more, less) = divmod(step, ONE), divmod(remainder, ONE)
    n = whole + direction * np.arange(count, dtype=np.int64)
    places: NDArray[np.int64] = n * _wrapped(high) + _wrapped(more) + ((n * low + less) >> 32)
    return places


def _too_fine(wavelengths: list[float], octave: int, spacing: float) -> str:
    if octave == 0:
        return (
            f"wavelength = {wavelengths[0]:g} m: far below the spacing of {spacing:g} m; "
            "use a longer one"
        )
    return (
        f"octaves = {len(wavelengths)}: octave {octave + 1} has a wavelength of "
        f"{wavelengths[octave]:g} m, far below the spacing of {spacing:g} m; use fewer"
    )


def _skewed(cosine: float, sine: float) -> tuple[float, float, float, float]:
    u, v = (cosine, -sine), (sine, cosine)
    both = tuple(SKEW * (a + b) for a, b in zip(u, v, strict=True))
    return (u[0] + both[0], u[1] + both[1], v[0] + both[0], v[1] + both[1])


def _wrapped(value: int) -> int:
    """Return an integer as the signed 64-bit number with the same low bits."""
    return (value + 2**63) % 2**64 - 2**63
