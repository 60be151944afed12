"""Thin-plate relaxation in NumPy: the readable definition, and the oracle of ``dequantise.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F = np.float32
Heights = NDArray[np.float32]
PAIRS = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Directions of opposite neighbours: down, across and the two diagonals."""


def above(values: Heights, stride: int) -> Heights:
    """Return the mean of the eight neighbours above each point; pairs cut by the edge count 0."""
    rows, cols = values.shape
    pairs = []
    for south, east in PAIRS:
        total = np.zeros_like(values)
        dy, dx = south * stride, abs(east) * stride
        if rows > 2 * dy and cols > 2 * dx:
            inside = slice(dy, rows - dy), slice(dx, cols - dx)

            def at(sign: int, dy: int = dy, slant: int = east * stride, dx: int = dx) -> Heights:
                top, left = dy + sign * dy, dx + sign * slant
                return values[top : top + rows - 2 * dy, left : left + cols - 2 * dx]

            here = values[inside]
            total[inside] = (at(-1) - here) + (at(1) - here)
        pairs.append(total)
    down, across, first, second = pairs
    return (F(2) * (down + across) + (first + second)) * F(0.083333336)


def wide(start: Heights, stride: int, limit: float) -> NDArray[np.bool_]:
    """Return where heights ``stride`` samples to every side differ by no more than ``limit``."""
    result = np.ones(start.shape, dtype=bool)
    for axis in (0, 1):
        along = np.moveaxis(start, axis, 0)
        found = np.moveaxis(result, axis, 0)
        near = np.abs(along[stride:] - along[:-stride]) <= F(limit)
        found[stride:] &= near
        found[:-stride] &= near
    return result


def relax(
    height: Heights, start: Heights, is_wide: NDArray[np.bool_], half_step: float, stride: int
) -> Heights:
    """Return the ground after it has straightened a little, within half a step of ``start``."""
    wanted = height - F(0.55) * above(above(height, stride), stride)
    low, high = start - F(half_step), start + F(half_step)
    bounded = np.where(wanted < low, low, np.where(wanted > high, high, wanted))
    return np.where(is_wide, bounded, height)
