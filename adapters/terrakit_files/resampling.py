"""Moves samples of a grid to another spacing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def resampled(
    values: NDArray[np.floating], spacings: tuple[float, float], spacing: float
) -> NDArray[np.float64]:
    """Return a grid with square cells, whose north-west sample stays where it is.

    Linear between samples; where the new grid is coarser, a triangle as wide as the new spacing
    averages what lies under it.

    Parameters
    ----------
    values
        Samples of shape (rows, cols).
    spacings
        Distance between rows and between columns now.
    spacing
        Distance between samples of the result.
    """
    field = np.asarray(values, dtype=np.float64)
    for axis, old in enumerate(spacings):
        field = _along(field, axis, spacing / old)
    return field


def samples_after(count: int, old: float, new: float) -> int:
    """Return how many samples of spacing ``new`` fit where ``count`` of spacing ``old`` are."""
    return int(np.floor((count - 1) * old / new + 1e-6)) + 1


def _along(field: NDArray[np.float64], axis: int, ratio: float) -> NDArray[np.float64]:
    count = field.shape[axis]
    if abs(ratio - 1.0) < 1e-9 or count == 1:
        return field
    place = np.arange(samples_after(count, 1.0, ratio)) * ratio
    reach = max(1.0, ratio)
    nearest = np.round(place).astype(np.int64)
    shape = [1, 1]
    shape[axis] = -1
    total = np.zeros((), np.float64)
    weights = np.zeros(len(place))
    for offset in range(-int(np.ceil(reach)), int(np.ceil(reach)) + 1):
        index = nearest + offset
        weight = np.maximum(0.0, 1.0 - np.abs(place - index) / reach)
        weight[(index < 0) | (index >= count)] = 0.0
        if not weight.any():
            continue
        taken = np.take(field, np.clip(index, 0, count - 1), axis=axis)
        total = total + taken * weight.reshape(shape)
        weights += weight
    return total / weights.reshape(shape)
