"""Perlin's improved noise as he published it: a yardstick, and for whoever needs his very numbers.

K. Perlin, "Improving noise", SIGGRAPH 2002, with his permutation of 256 numbers and 12 gradients.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

PERMUTATION = np.array(
    [
        *(151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225),
        *(140, 36, 103, 30, 69, 142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148),
        *(247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32),
        *(57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175),
        *(74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122),
        *(60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54),
        *(65, 25, 63, 161, 1, 216, 80, 73, 209, 76, 132, 187, 208, 89, 18, 169),
        *(200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186, 3, 64),
        *(52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212),
        *(207, 206, 59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213),
        *(119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9),
        *(129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104),
        *(218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162, 241),
        *(81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157),
        *(184, 84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93),
        *(222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78, 66, 215, 61, 156, 180),
    ]
)
DIRECTIONS = np.array(
    [
        *((1, 1, 0), (-1, 1, 0), (1, -1, 0), (-1, -1, 0)),
        *((1, 0, 1), (-1, 0, 1), (1, 0, -1), (-1, 0, -1)),
        *((0, 1, 1), (0, -1, 1), (0, 1, -1), (0, -1, -1)),
        *((1, 1, 0), (0, -1, 1), (-1, 1, 0), (0, -1, -1)),
    ]
)
"""Gradients by the four low bits of the hash: to the edges of a cube, four of them twice."""


def classic_perlin(x: ArrayLike, y: ArrayLike, z: ArrayLike = 0.0) -> NDArray[np.float64]:
    """Return improved Perlin noise; its period is 256.

    ``classic_perlin(3.14, 42, 7)`` is 0.13691995878400012, as in Perlin's own program.
    """
    x, y, z = (np.asarray(v, dtype=np.float64) for v in np.broadcast_arrays(x, y, z))
    cell = [np.floor(v).astype(np.int64) for v in (x, y, z)]
    x, y, z = (v - whole for v, whole in zip((x, y, z), cell, strict=True))

    def corner(east: int, north: int, up: int) -> NDArray[np.float64]:
        g = corner_direction(cell[0] + east, cell[1] + north, cell[2] + up)
        ramp: NDArray[np.float64] = (
            g[..., 0] * (x - east) + g[..., 1] * (y - north) + g[..., 2] * (z - up)
        )
        return ramp

    u, v, w = fade(x), fade(y), fade(z)
    levels = []
    for up in (0, 1):
        south = _between(u, corner(0, 0, up), corner(1, 0, up))
        north = _between(u, corner(0, 1, up), corner(1, 1, up))
        levels.append(_between(v, south, north))
    return _between(w, *levels)


def corner_direction(i: ArrayLike, j: ArrayLike, k: ArrayLike = 0) -> NDArray[np.int64]:
    """Return the gradient at lattice points, as x, y and z in the last axis."""
    i, j, k = (np.asarray(n) & 255 for n in (i, j, k))
    first = (PERMUTATION[i] + j) & 255
    second = (PERMUTATION[first] + k) & 255
    directions: NDArray[np.int64] = DIRECTIONS[PERMUTATION[second] & 15]
    return directions


def fade(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 6 t^5 - 15 t^4 + 10 t^3."""
    return t * t * t * (t * (t * 6 - 15) + 10)


def _between(
    t: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    return a + t * (b - a)
