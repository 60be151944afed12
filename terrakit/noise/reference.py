"""Lattice noise in NumPy: the readable definition, and the oracle of ``noise.cl``.

Every basis takes the cell ``i, j`` of the lattice (any integers; they wrap at 2^32), the fraction
``x, y`` in it, in [0, 1), and two 32-bit seed words, and returns float32 of the broadcast shape.
The same operations in the same order as in ``noise.cl`` return the same bits.

A lattice point hashes to the product of two words, one of its column and one of its row::

    h(i, j) = (m_i ^ m_i >> 15 ^ s) (m_j' ^ m_j' >> 15 ^ s')  mod 2^32,  m_k = k P, m_k' = k P'

which costs one multiply a point however many points a sample needs. The lines' multipliers are
Knuth's golden ratio and a prime of xxHash (Y. Collet, 2012); the seeds go through lowbias32.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrakit.compute import exact

F = np.float32
U = np.uint32
Values = NDArray[np.float32]
Words = NDArray[np.uint32]
Evaluate = Callable[[ArrayLike, ArrayLike, ArrayLike, ArrayLike, int, int], Values]
Metric = Literal["euclidean", "euclidean_squared", "manhattan", "chebyshev", "minkowski_half"]
Feature = Literal["f1", "f2", "f3", "f4", "f2_minus_f1", "crackle", "value"]
METRICS: tuple[Metric, ...] = get_args(Metric)
FEATURES: tuple[Feature, ...] = get_args(Feature)

COLUMN = U(0x9E3779B1)
ROW = U(0x85EBCA77)
GRADIENT_SCALE = F(8.6994456e-10)
SIMPLEX_SCALE = F(4.765417e-8)
UNSKEW = F(0.21132487)
SIDE = F(4294967296.0)
"""Width of a cell while distances are measured: then hashes are offsets as they are."""
RANGES: dict[Metric, dict[Feature, float]] = {
    "euclidean": {"f1": 1, "f2": 1.25, "f3": 1.375, "f4": 1.5, "f2_minus_f1": 1},
    "euclidean_squared": {"f1": 1, "f2": 1.5, "f3": 1.875, "f4": 2.25, "f2_minus_f1": 1.375},
    "manhattan": {"f1": 1.25, "f2": 1.5, "f3": 1.75, "f4": 2, "f2_minus_f1": 1.25},
    "chebyshev": {"f1": 0.875, "f2": 1.125, "f3": 1.25, "f4": 1.375, "f2_minus_f1": 0.875},
    "minkowski_half": {"f1": 2.375, "f2": 2.75, "f3": 3.125, "f4": 3.5, "f2_minus_f1": 2.25},
}
"""The distance, in cells, that cellular noise shows as 1; a thousandth of places is beyond."""


def white(i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int) -> Values:
    """Return one value a cell, uniform in [-1, 1]."""
    i, j, x, y = _places(i, j, x, y)
    seed = _seeds(low, high)
    return _signed(_spread(_line(i * COLUMN, seed[0]) * _line(j * ROW, seed[1])))


def value(i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int) -> Values:
    """Return values at lattice points, joined by quintics; in [-1, 1]."""
    return value_slope(i, j, x, y, low, high)[0]


def value_slope(
    i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int
) -> tuple[Values, Values, Values]:
    """Return value noise and its derivatives by ``x`` and ``y``, per cell."""
    i, j, x, y = _places(i, j, x, y)
    west, east, south, north = _corners(i, j, _seeds(low, high))
    a, b = _signed(west * south), _signed(east * south)
    c, d = _signed(west * north), _signed(east * north)
    fx, fy = fade(x), fade(y)
    low_side = a + fx * (b - a)
    high_side = c + fx * (d - c)
    dx = _fade_slope(x) * ((b - a) + fy * ((d - c) - (b - a)))
    dy = _fade_slope(y) * (high_side - low_side)
    return low_side + fy * (high_side - low_side), dx, dy


def gradient(i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int) -> Values:
    """Return gradient noise in [-1, 1], nothing at lattice points (Perlin 2002)."""
    return gradient_slope(i, j, x, y, low, high)[0]


def gradient_slope(
    i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int
) -> tuple[Values, Values, Values]:
    """Return gradient noise and its derivatives by ``x`` and ``y``, per cell."""
    i, j, x, y = _places(i, j, x, y)
    west, east, south, north = _corners(i, j, _seeds(low, high))
    directions = (
        *_direction(west * south),
        *_direction(east * south),
        *_direction(west * north),
        *_direction(east * north),
    )
    noise, dx, dy = joined_ramps(directions, x, y)
    return noise * GRADIENT_SCALE, dx * GRADIENT_SCALE, dy * GRADIENT_SCALE


def joined_ramps(
    directions: tuple[Values, ...], x: Values, y: Values
) -> tuple[Values, Values, Values]:
    """Return ramps of the given slopes at a cell's corners, joined by quintics, and their slope.

    ``directions`` are x and y of the gradients in the south-west, south-east, north-west and
    north-east. This is the part of Perlin's noise that does not depend on how he hashed.
    """
    ax, ay, bx, by, cx, cy, ex, ey = directions
    x1, y1 = x - F(1), y - F(1)
    a = ax * x + ay * y
    b = bx * x1 + by * y
    c = cx * x + cy * y1
    d = ex * x1 + ey * y1
    fx, fy = fade(x), fade(y)
    low_side = a + fx * (b - a)
    high_side = c + fx * (d - c)
    low_x = ax + fx * (bx - ax)
    high_x = cx + fx * (ex - cx)
    low_y = ay + fx * (by - ay)
    high_y = cy + fx * (ey - cy)
    across = (b - a) + fy * ((d - c) - (b - a))
    dx = (low_x + fy * (high_x - low_x)) + _fade_slope(x) * across
    dy = (low_y + fy * (high_y - low_y)) + _fade_slope(y) * (high_side - low_side)
    return low_side + fy * (high_side - low_side), dx, dy


def simplex(i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int) -> Values:
    """Return simplex noise in [-1, 1] at a skewed position (Perlin 2001)."""
    return simplex_slope(i, j, x, y, low, high)[0]


def simplex_slope(
    i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int
) -> tuple[Values, Values, Values]:
    """Return simplex noise and its derivatives along the straight axes, not the skewed, per cell.

    Each corner of a triangle spreads ``max(0, 1/2 - r^2)^4 (g . r)``: with 1/2 it ends on the
    opposite side, and no crease is left there as with the 0.6 that is often seen.
    """
    i, j, x, y = _places(i, j, x, y)
    west, east, south, north = _corners(i, j, _seeds(low, high))
    right = x > y
    unskew = (x + y) * UNSKEW
    x0, y0 = x - unskew, y - unskew
    x1 = x0 + np.where(right, UNSKEW - F(1), UNSKEW)
    y1 = y0 + np.where(right, UNSKEW, UNSKEW - F(1))
    x2 = x0 + (F(2) * UNSKEW - F(1))
    y2 = y0 + (F(2) * UNSKEW - F(1))
    ax, ay = _direction(west * south)
    bx, by = _direction(np.where(right, east, west) * np.where(right, south, north))
    cx, cy = _direction(east * north)
    a = ax * x0 + ay * y0
    b = bx * x1 + by * y1
    c = cx * x2 + cy * y2
    ta, tb, tc = _reach(x0, y0), _reach(x1, y1), _reach(x2, y2)
    sa, sb, sc = ta * ta, tb * tb, tc * tc
    pa, pb, pc = sa * sa, sb * sb, sc * sc
    fa = F(8) * (sa * ta) * a
    fb = F(8) * (sb * tb) * b
    fc = F(8) * (sc * tc) * c
    ux = ((pa * ax - fa * x0) + (pb * bx - fb * x1)) + (pc * cx - fc * x2)
    uy = ((pa * ay - fa * y0) + (pb * by - fb * y1)) + (pc * cy - fc * y2)
    noise = ((pa * a + pb * b) + pc * c) * SIMPLEX_SCALE
    return noise, ux * SIMPLEX_SCALE, uy * SIMPLEX_SCALE


@dataclass(frozen=True)
class Nearest:
    """Distances from a place to the points nearest to it, in cells, and the nearest's hash."""

    distances: tuple[Values, ...]
    point: Words


def nearest_points(
    i: ArrayLike,
    j: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    low: int,
    high: int,
    metric: Metric = "euclidean",
    across: Literal[4, 5] = 5,
    count: int = 4,
) -> Nearest:
    """Return how far the nearest points are, one of which lies anywhere in each cell.

    Parameters
    ----------
    i, j, x, y, low, high
        As for the bases.
    metric
        How distance is measured.
    across
        Cells that are searched: 4 by 4 about the nearest lattice point, beyond which all is 1.5
        away, or 5 by 5 about the cell, beyond which all is 2 away.
    count
        How many points; more cost more.

    Notes
    -----
    Exact, whatever the points: the nearest of all metrics but ``minkowski_half``, for which it
    may lie further out where the nearest found is beyond 2; all four of ``euclidean`` and
    ``chebyshev`` on 5 by 5. A third or fourth of ``manhattan`` is exact where it is within 2.
    """
    i, j, x, y = _places(i, j, x, y)
    seed = _seeds(low, high)
    columns, columns_at = _lines(i, x, COLUMN, seed[0], across)
    rows, rows_at = _lines(j, y, ROW, seed[1], across)
    kept = [np.full(x.shape, F(1e30)) for _ in range(count)]
    point = np.zeros(x.shape, U)
    for row, row_at in zip(rows, rows_at, strict=True):
        for column, column_at in zip(columns, columns_at, strict=True):
            hashes = column * row
            to_x = column_at + _whole(hashes)
            to_y = row_at + _whole(hashes << U(11))
            apart = _apart(to_x, to_y, metric)
            point = np.where(apart < kept[0], hashes, point)
            for rank in range(count):
                beyond = np.where(kept[rank] > apart, kept[rank], apart)
                kept[rank] = np.where(kept[rank] < apart, kept[rank], apart)
                apart = beyond
    return Nearest(tuple(_length(apart, metric) for apart in kept), point)


def cellular(feature: Feature, metric: Metric = "euclidean") -> Evaluate:
    """Return the function that evaluates a feature of cellular noise (Worley 1996).

    Distances are shown from -1 for nothing to 1 for :data:`RANGES`; ``crackle`` is ten times the
    gap between the first and second, cut at 1; ``value`` is uniform in [-1, 1] for each point.
    """
    across = cells_across(feature, metric)
    count = {"f1": 1, "value": 1, "f3": 3, "f4": 4}.get(feature, 2)

    def evaluate(
        i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike, low: int, high: int
    ) -> Values:
        near = nearest_points(i, j, x, y, low, high, metric, across, count)
        if feature == "value":
            return _signed(_spread(near.point))
        shown = near.distances[-1]
        if feature in ("f2_minus_f1", "crackle"):
            shown = near.distances[1] - near.distances[0]
        if feature == "crackle":
            shown = shown * F(10)
            return np.where(shown < F(1), shown, F(1)) * F(2) - F(1)
        return shown * F(2 / RANGES[metric][feature]) - F(1)

    return evaluate


def cells_across(feature: Feature, metric: Metric) -> Literal[4, 5]:
    """Return how many cells a side have to be searched, so that nothing nearer is missed."""
    nearest_only = feature in ("f1", "value")
    near = metric == "chebyshev" or (nearest_only and metric.startswith("euclidean"))
    return 4 if near else 5


def cell_points(i: ArrayLike, j: ArrayLike, low: int, high: int) -> tuple[Values, Values]:
    """Return where in each cell its point lies: x and y in [0, 1], in cells from its corner."""
    i, j, _, _ = _places(i, j, 0, 0)
    seed = _seeds(low, high)
    hashes = _line(i * COLUMN, seed[0]) * _line(j * ROW, seed[1])
    along = (_whole(hashes) + SIDE / 2, _whole(hashes << U(11)) + SIDE / 2)
    return along[0] / SIDE, along[1] / SIDE


def _places(
    i: ArrayLike, j: ArrayLike, x: ArrayLike, y: ArrayLike
) -> tuple[Words, Words, Values, Values]:
    """Return cells as words and fractions as float32, all of one shape."""
    i, j, x, y = np.broadcast_arrays(*np.atleast_1d(i, j, x, y))
    return i.astype(U), j.astype(U), x.astype(F), y.astype(F)


def _seeds(low: int, high: int) -> tuple[np.uint32, np.uint32]:
    """Return the seed words of the columns and of the rows."""
    column = exact.mix((int(low) + 0x68E31DA4) & 0xFFFFFFFF)
    row = exact.mix(U(high) ^ column)
    return column[0], row[0]


def _line(product: Words, seed: np.uint32) -> Words:
    """Return the word of a lattice line from its index times its multiplier."""
    return product ^ (product >> U(15)) ^ seed


def _corners(i: Words, j: Words, seed: tuple[np.uint32, np.uint32]) -> tuple[Words, ...]:
    """Return the words of the lines west, east, south and north of a cell."""
    column, row = i * COLUMN, j * ROW
    return (
        _line(column, seed[0]),
        _line(column + COLUMN, seed[0]),
        _line(row, seed[1]),
        _line(row + ROW, seed[1]),
    )


def _spread(hashes: Words) -> Words:
    """Return hashes whose low bits are as good as the high ones."""
    return (hashes ^ (hashes >> U(15))) * U(0x846CA68B)


def _signed(hashes: Words) -> Values:
    """Return numbers in [-1, 1] from the high bits."""
    return _whole(hashes) * F(4.656612873077393e-10)


def _whole(hashes: Words) -> Values:
    """Return hashes as signed whole numbers, rounded to float32."""
    whole: Values = hashes.view(np.int32).astype(F)
    return whole


def fade(t: Values) -> Values:
    """Return 6 t^5 - 15 t^4 + 10 t^3: flat and not bent at 0 and 1."""
    return t * t * t * (t * (t * 6 - 15) + 10)


def _fade_slope(t: Values) -> Values:
    s = t * (t - F(1))
    return F(30) * (s * s)


def _direction(hashes: Words) -> tuple[Values, Values]:
    """Return lattice gradients of any direction, times 2^31.

    They end anywhere on the square ``|x| + |y| = 1``. Their covariance is a circle's, and being
    longest along the axes they make up for the lattice, whose hills tend to the diagonals: slopes
    of the noise differ by 9 percent in number between directions, with true circles by 24.
    """
    p = _whole(hashes)
    rest: Values = 2**31 - np.abs(p)
    return p, np.where(hashes & U(0x8000), -rest, rest)


def _reach(x: Values, y: Values) -> Values:
    reach = F(0.5) - (x * x + y * y)
    held: Values = np.where(reach > F(0), reach, F(0))
    return held


def _lines(
    index: Words, fraction: Values, multiplier: np.uint32, seed: np.uint32, across: int
) -> tuple[list[Words], list[Values]]:
    """Return the words of the lines of cells to search and where their middles are."""
    if across == 4:
        back = np.where(fraction < F(0.5), U(2), U(1))
        start = np.where(fraction < F(0.5), F(-1.5) * SIDE, F(-0.5) * SIDE)
    else:
        back = np.broadcast_to(U(2), index.shape)
        start = np.broadcast_to(F(-1.5) * SIDE, fraction.shape)
    product = (index - back) * multiplier
    words = [_line(product + np.array([n], U) * multiplier, seed) for n in range(across)]
    middles = [(start + F(n) * SIDE) - fraction * SIDE for n in range(across)]
    return words, middles


def _apart(x: Values, y: Values, metric: Metric) -> Values:
    """Return what a metric measures: something that grows with the distance."""
    if metric in ("euclidean", "euclidean_squared"):
        return x * x + y * y
    x, y = np.abs(x), np.abs(y)
    if metric == "manhattan":
        return x + y
    if metric == "chebyshev":
        return np.where(x > y, x, y)
    return np.sqrt(x) + np.sqrt(y)


def _length(apart: Values, metric: Metric) -> Values:
    """Return the distance in cells from what the metric measured."""
    if metric == "euclidean":
        return np.sqrt(apart) * F(2.3283064365386963e-10)
    if metric == "euclidean_squared":
        return apart * F(5.421010862427522e-20)
    if metric == "minkowski_half":
        return apart * apart * F(2.3283064365386963e-10)
    return apart * F(2.3283064365386963e-10)
