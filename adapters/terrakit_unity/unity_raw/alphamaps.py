"""Weights of ground materials as RGBA pictures whose channels sum to 255."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray

CHANNELS = 4
ROWS = 128
"""Rows that are rounded at a time; bounds the memory."""


def cell_weights(layers: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return weights of shape (layers, rows - 1, cols - 1) that sum to 1.

    Unity's alphamaps are sampled in the cells: a cell is the mean of its four corners. Where no
    material has a weight the first one takes all.
    """
    stack = np.maximum(np.stack(layers), np.float32(0.0))
    columns = stack[:, :, :-1] + stack[:, :, 1:]
    cells: NDArray[np.float32] = (columns[:, :-1] + columns[:, 1:]) * np.float32(0.25)
    total = cells.sum(axis=0)
    cells[0][total <= 0] = 1.0
    cells /= np.where(total <= 0, np.float32(1.0), total)
    return cells


def bytes_of(weights: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return weights as whole numbers that sum to 255 in every cell (largest remainder)."""
    numbers = np.empty(weights.shape, np.uint8)
    for first in range(0, weights.shape[1], ROWS):
        chosen = np.s_[:, first : first + ROWS]
        scaled = weights[chosen].astype(np.float64) * 255.0
        whole = np.floor(scaled)
        missing = 255 - whole.sum(axis=0).astype(np.int64)
        order = np.argsort(whole - scaled, axis=0, kind="stable")
        rank = np.argsort(order, axis=0, kind="stable")
        numbers[chosen] = whole + (rank < missing)
    return numbers


def splat_png(weights: NDArray[np.uint8]) -> bytes:
    """Return up to four weights as a RGBA PNG, north up."""
    from PIL import Image

    _, rows, cols = weights.shape
    picture = np.zeros((rows, cols, CHANNELS), np.uint8)
    picture[..., : len(weights)] = np.moveaxis(weights, 0, -1)
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "PNG", compress_level=4)
    return stream.getvalue()
