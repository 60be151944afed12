"""Fractal gradient noise in NumPy: the readable definition, and the oracle of ``fbm.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import check_cancelled, exact

F = np.float32
U = np.uint32
BLOCK = 64
"""Rows that are computed together, to bound the memory of the temporaries."""


def fractal_sum(
    shape: tuple[int, int],
    lattice: NDArray[np.int64],
    weight: NDArray[np.float32],
    seeds: NDArray[np.uint32],
    offset: float,
) -> NDArray[np.float32]:
    """Return the weighted sum of octaves on a grid; arguments as in ``fbm_sum``."""
    rows, cols = shape
    elevation = np.empty(shape, dtype=F)
    col = np.arange(cols, dtype=np.int64)[None, :]
    for first in range(0, rows, BLOCK):
        check_cancelled()
        row = np.arange(first, min(first + BLOCK, rows), dtype=np.int64)[:, None]
        total = np.full((len(row), cols), F(offset))
        for octave, at in enumerate(lattice):
            u = at[0] + col * at[1] + row * at[2]
            v = at[3] + col * at[4] + row * at[5]
            low, high = seeds[2 * octave], seeds[2 * octave + 1]
            total = total + weight[octave] * noise(u, v, (low, high))
        elevation[first : first + len(row)] = total
    return elevation


def noise(
    u: NDArray[np.int64], v: NDArray[np.int64], seed: tuple[np.uint32, np.uint32]
) -> NDArray[np.float32]:
    """Return gradient noise within -1 to 1 at lattice positions in 32.32 fixed point."""
    i, x = _split(u)
    j, y = _split(v)
    west, east = exact.mix(i ^ seed[0]), exact.mix((i + U(1)) ^ seed[0])
    sw = exact.mix(exact.mix(west + j) ^ seed[1])
    se = exact.mix(exact.mix(east + j) ^ seed[1])
    nw = exact.mix(exact.mix(west + (j + U(1))) ^ seed[1])
    ne = exact.mix(exact.mix(east + (j + U(1))) ^ seed[1])
    a = _corner(sw, x, y)
    b = _corner(se, x - F(1), y)
    c = _corner(nw, x, y - F(1))
    d = _corner(ne, x - F(1), y - F(1))
    fx, fy = _fade(x), _fade(y)
    south = a + fx * (b - a)
    north = c + fx * (d - c)
    return (south + fy * (north - south)) * F(1.41421356)


def _split(position: NDArray[np.int64]) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Return the lattice index and the fraction in [0, 1) of fixed-point positions."""
    bits = position.view(np.uint64)
    fraction = (bits & np.uint64(0xFFFFFFFF)).astype(U) >> U(8)
    return (bits >> np.uint64(32)).astype(U), fraction.astype(F) * F(2.0**-24)


def _corner(
    hashes: NDArray[np.uint32], x: NDArray[np.float32], y: NDArray[np.float32]
) -> NDArray[np.float32]:
    t = exact.uniform(hashes)
    c, s = _quarter_sine(F(1) - t), _quarter_sine(t)
    gx = np.where(hashes & U(1), -c, c)
    gy = np.where(hashes & U(2), -s, s)
    return gx * x + gy * y


def _quarter_sine(t: NDArray[np.float32]) -> NDArray[np.float32]:
    s = t * t
    return t * (F(1.57079032) + s * (F(-0.64589283) + s * (F(0.07943441) + s * F(-0.00433310))))


def _fade(t: NDArray[np.float32]) -> NDArray[np.float32]:
    return t * t * t * (t * (t * F(6) - F(15)) + F(10))
