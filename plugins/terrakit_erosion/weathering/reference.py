"""Weathering in NumPy: the readable definition, and the oracle of ``weathering.cl``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
STEEPEST = F(15)
SHARPEST = F(8)
"""The largest that steep faces and sharp edges count: faces 4 times, edges 9 times."""
DEEPEST = 2**30
"""Thickest debris, quanta."""


class Constants(NamedTuple):
    """What a step needs to know besides fields; heights in quanta."""

    steepness: float
    """Half the square of the slope of one quantum to an axial neighbour."""
    sharpness: float
    """How much faster one quantum of convexity, times 6, weathers."""
    shield: float
    """Exponent of 2 by which a quantum of cover slows production; negative."""
    hump: float
    """0 where bare rock weathers fastest, else B of ``4 B y (1 - B y)``."""
    depth: float
    """Rock that makes as much debris as slows production by e."""
    deepest: float
    """The most that a step weathers."""


def produce(
    height: Counts, bed: Counts, rate: Floats, carried: Floats, constants: Constants
) -> Counts:
    """Return how much bedrock turns to debris in a step, quanta.

    The rate follows the exposure; under the debris that a step makes it falls already within the
    step, so that for exponential production the number of steps does not matter.

    Parameters
    ----------
    height, bed
        Height of the ground and of the bedrock, quanta.
    rate
        Depth of bare, flat rock that would weather in a step, quanta.
    carried
        What was due before and is less than a quantum; changed in place.
    constants
        See :class:`Constants`.
    """
    steepness, sharpness, shield, hump, depth, deepest = (F(value) for value in constants)
    cover = height - bed
    exposed = _exposed(height, steepness, sharpness)
    with np.errstate(under="ignore"):  # deep under cover nothing weathers
        y = exact.exp2(shield * cover.astype(F))
        by = hump * y
        covered = F(4) * by * (F(1) - by) if hump > 0 else y
        q = np.minimum(rate * exposed * covered / depth, F(1e30))
        gained = np.minimum(depth * _logarithm(q), deepest)
    due = carried + np.where(cover < DEEPEST, gained, F(0))
    whole = due.astype(np.int32)
    carried[...] = due - whole.astype(F)
    return whole


def _exposed(height: Counts, steepness: np.float32, sharpness: np.float32) -> Floats:
    """Return how much faster a face of this slope and an edge this sharp weather.

    The front advances across the face, so a steep one comes down by the secant of its slope.
    """
    rows, cols = height.shape
    around = np.pad(height, 1, mode="edge")

    def above(row: int, col: int) -> Floats:
        there = slice(1 + row, 1 + row + rows), slice(1 + col, 1 + col + cols)
        return (height - around[there]).astype(F)

    n, s, w, e = above(-1, 0), above(1, 0), above(0, -1), above(0, 1)
    nw, ne, sw, se = above(-1, -1), above(-1, 1), above(1, -1), above(1, 1)
    square = steepness * ((n * n + s * s) + (w * w + e * e))
    face = exact.power(F(1) + np.minimum(square, STEEPEST), 0.5)
    convex = sharpness * (F(4) * ((n + s) + (w + e)) + ((nw + se) + (ne + sw)))
    edge: Floats = F(1) + np.maximum(np.minimum(convex, SHARPEST), F(0))
    return face * edge


def _logarithm(q: Floats) -> Floats:
    """Return the natural logarithm of 1 + q."""
    series = q * (F(1) - q * (F(0.5) - q * F(0.333333333)))
    return np.where(q < F(0.01), series, exact.log2(F(1) + q) * F(0.69314718)).astype(F)
