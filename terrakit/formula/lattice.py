"""Where noise lives: lattices in the world, one an octave, in 64-bit fixed point.

A sample's position on a lattice is an integer, a whole number of 2**-32 of a lattice cell, from
the sample's world index. So a tile far from the origin is as sharp as one at it, and equals the
same part of a larger map bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Lattice:
    """The lattices of one noise, an octave each.

    Parameters
    ----------
    basis
        Name of the noise basis.
    steps
        Six integers an octave: u at the first sample, per column, per row; the same for v.
    metres
        Four numbers an octave: what u and v gain by a metre east and by a metre north.
    turns
        Cosine and sine of each octave's turn.
    seeds
        Two 32-bit words an octave.
    """

    basis: str
    steps: NDArray[np.int64]
    metres: NDArray[np.float32]
    turns: NDArray[np.float32]
    seeds: NDArray[np.uint32]

    @property
    def octaves(self) -> int:
        """How many octaves there are."""
        return len(self.steps)


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
    steps, metres, turns, seeds = [], [], [], []
    for octave, wavelength in enumerate(wavelengths):
        step = grid.spacing / wavelength * ONE
        if step >= 2**52:
            raise ParameterError(
                f"octaves = {len(wavelengths)}: octave {octave + 1} has a wavelength of "
                f"{wavelength:g} m, far below the spacing of {grid.spacing:g} m; use fewer"
            )
        cosine, sine = TURNS[octave % len(TURNS)] if turned else STRAIGHT
        matrix = _skewed(cosine, sine) if skewed else (cosine, -sine, sine, cosine)
        shift = seed_words(*words, "shift", octave)
        row = []
        for axis in (0, 1):
            east, north = (round(part * step) for part in matrix[2 * axis : 2 * axis + 2])
            start = (x * east + y * north) // FINE
            row += [_wrapped(v) for v in (start + (shift[axis] << 16), east, -north)]
        steps.append(row)
        metres.append([part / wavelength for part in matrix])
        turns.append((cosine, sine))
        seeds.append(seed_words(*words, octave))
    return Lattice(
        basis,
        np.array(steps, dtype=np.int64).reshape(-1, 6),
        np.array(metres, dtype=np.float32).reshape(-1, 4),
        np.array(turns, dtype=np.float32).reshape(-1, 2),
        np.array(seeds, dtype=np.uint32).reshape(-1, 2),
    )


def free_lattice(basis: str, skewed: bool, words: tuple[int, int]) -> Lattice:
    """Return a lattice whose positions are given in cells, by formulas alone."""
    shift = seed_words(*words, "shift", 0)
    matrix = _skewed(1.0, 0.0) if skewed else (1.0, 0.0, 0.0, 1.0)
    return Lattice(
        basis,
        np.array([[shift[0] << 16, 0, 0, shift[1] << 16, 0, 0]], dtype=np.int64),
        np.array([matrix], dtype=np.float32),
        np.array([STRAIGHT], dtype=np.float32),
        np.array([seed_words(*words, 0)], dtype=np.uint32),
    )


def _skewed(cosine: float, sine: float) -> tuple[float, float, float, float]:
    u, v = (cosine, -sine), (sine, cosine)
    both = tuple(SKEW * (a + b) for a, b in zip(u, v, strict=True))
    return (u[0] + both[0], u[1] + both[1], v[0] + both[0], v[1] + both[1])


def _wrapped(value: int) -> int:
    """Return an integer as the signed 64-bit number with the same low bits."""
    return (value + 2**63) % 2**64 - 2**63
