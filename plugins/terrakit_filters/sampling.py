"""Taking a terrain along to other samples: heights by cubics, layers linearly, numbers as they are.

Cubics are those of Catmull and Rom, which pass through every sample and keep planes; beyond its
edge a field goes on point-symmetrically, so that they do so there too. Everything is computed in
float64 from + - * and /, one tap after the other, so that the result is the same everywhere.

References
----------
E. Catmull and R. Rom, "A class of local interpolating splines", 1974. R. Keys, "Cubic convolution
interpolation for digital image processing", IEEE ASSP 29, 1981.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Field, Grid, Heightfield

F = np.float32
Numbers = NDArray[np.float64]
MARGIN = 2
NUMBERED = ("valid", "plate")
"""Layers whose values are names or yes and no: a mean of two of them means nothing."""


def taken_along(
    surface: Heightfield, grid: Grid, take: Callable[[Field, str], Field]
) -> Heightfield:
    """Return every layer on another grid; ``take`` gets a field and how: see :func:`way_of`."""
    layers = {name: take(surface.layer(name), way_of(name)) for name in surface}
    return Heightfield.on_grid(grid, layers.pop("elevation"), layers)


def way_of(layer: str) -> str:
    """Return how a layer is taken along: ``cubic``, ``linear`` or ``nearest``."""
    if layer == "elevation":
        return "cubic"
    numbered = layer in NUMBERED or layer.endswith(("_id", "_index"))
    return "nearest" if numbered else "linear"


def sampled(field: Field, row: Numbers, col: Numbers, way: str) -> Field:
    """Return a field at places between its samples; places outside are moved to its edge."""
    rows, cols = field.shape
    row = np.minimum(np.maximum(row, 0.0), rows - 1.0)
    col = np.minimum(np.maximum(col, 0.0), cols - 1.0)
    if way == "nearest":
        return field[_nearest(row), _nearest(col)]
    top, down = _cell(row, rows)
    left, right = _cell(col, cols)
    padded = _continued(field)
    width = padded.shape[1]
    first = (top + MARGIN - 1) * width + (left + MARGIN - 1)
    flat = padded.ravel()
    cubic = way == "cubic"
    weights = cubic_weights if cubic else _linear_weights
    offsets = range(0, 4) if cubic else range(1, 3)
    across, along = weights(down), weights(right)
    result = np.zeros(first.shape)
    for of_row, i in zip(across, offsets, strict=True):
        line = np.zeros_like(result)
        for of_col, j in zip(along, offsets, strict=True):
            line += of_col * flat.take(first + (i * width + j))
        result += of_row * line
    return result.astype(F)


def _nearest(at: Numbers) -> NDArray[np.intp]:
    return np.floor(at + 0.5).astype(np.intp)


def _cell(at: Numbers, count: int) -> tuple[NDArray[np.intp], Numbers]:
    """Return the sample before each place and how far it is beyond, 0 to 1."""
    before = np.minimum(np.floor(at).astype(np.intp), max(count - 2, 0))
    return before, at - before


def cubic_weights(t: Numbers) -> tuple[Numbers, ...]:
    """Return the weights of the four samples around places ``t`` beyond the second of them."""
    return (
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    )


def _linear_weights(t: Numbers) -> tuple[Numbers, ...]:
    return 1.0 - t, t


def _continued(field: Field, margin: int = MARGIN) -> Numbers:
    """Return the field with a margin, mirrored at the points of its edge."""
    wide = field.astype(np.float64)
    return np.pad(wide, margin, mode="reflect", reflect_type="odd")


def resampled(field: Field, row: Numbers, col: Numbers, step: float, way: str) -> Field:
    """Return a field at the crossings of rows and columns, ``step`` samples apart.

    Where the step is above one sample, the result is the mean under a tent as wide as the step,
    with weights that keep planes; so nothing finer than the new samples is folded into them.
    """
    if way == "nearest":
        rows = np.clip(_nearest(row), 0, field.shape[0] - 1)
        cols = np.clip(_nearest(col), 0, field.shape[1] - 1)
        return field[rows[:, None], cols[None, :]]
    margin = max(MARGIN, math.ceil(step) + 1)
    if way == "cubic":
        padded = _continued(field, margin)
    else:  # stay within the layer's own range
        padded = np.pad(field.astype(np.float64), margin, mode="edge")
    across = _along_one_axis(padded.T, *_taps(col, field.shape[1], step, way, margin))
    return _along_one_axis(across.T, *_taps(row, field.shape[0], step, way, margin)).astype(F)


def _taps(
    at: Numbers, count: int, step: float, way: str, margin: int
) -> tuple[NDArray[np.intp], Numbers]:
    """Return, a place, the padded samples that it sees and their weights."""
    at = np.minimum(np.maximum(at, 0.0), count - 1.0)
    before, beyond = _cell(at, count)
    if step <= 1.0:
        weights = cubic_weights(beyond) if way == "cubic" else _linear_weights(beyond)
        near = before[:, None] + (np.arange(-1, 3) if way == "cubic" else np.arange(2))
        return near + margin, np.stack(weights, axis=1)
    reach = math.ceil(step)
    near = before[:, None] + np.arange(-reach, reach + 2)
    off = near - at[:, None]
    tent = np.maximum(1.0 - np.abs(off) / step, 0.0)
    if way == "cubic":  # least squares of a line under the tent
        moments = [(tent * off**k).sum(axis=1, keepdims=True) for k in range(3)]
        free = moments[0] * moments[2] - moments[1] ** 2
        tent = tent * (moments[2] - moments[1] * off) / free
    near = np.clip(near + margin, 0, count + 2 * margin - 1)
    return near, tent / tent.sum(axis=1, keepdims=True)


def _along_one_axis(values: Numbers, index: NDArray[np.intp], weight: Numbers) -> Numbers:
    """Return weighted sums of rows, one tap after the other: no library decides their order."""
    values = np.ascontiguousarray(values)
    result = np.zeros((len(index), values.shape[1]))
    for tap in range(index.shape[1]):
        if weight[:, tap].any():
            result += weight[:, tap, None] * values[index[:, tap]]
    return result
