"""Thermal erosion in NumPy: the readable definition, and the oracle of ``thermal.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.mesh import EdgeGraph

F = np.float32
Counts = NDArray[np.int32]
DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


def relax(
    height: Counts, talus: Counts, axial: float, diagonal: float, exported: Counts | None
) -> Counts:
    """Return heights after one sweep of the flux form.

    Parameters
    ----------
    height
        Heights of shape (rows, cols), quanta.
    talus
        Largest difference to an axial neighbour that stays put, quanta; () or (rows, cols).
    axial, diagonal
        Share of the excess that an axial and a diagonal neighbour gets.
    exported
        Where the borders are open, what left through each cell so far; changed in place.
    """
    sum_out = np.zeros_like(height)
    for direction in DIRECTIONS:
        slanted = 0 not in direction
        share = F(diagonal if slanted else axial)
        here, there = _pairs(height.shape, direction)
        d = height[here] - height[there]
        limit = _limit(talus, here, there, d, slanted)
        sum_out[here] += (share * _excess(d, limit).astype(F)).astype(np.int32)
        if exported is not None:
            _leave(height, talus, direction, share, sum_out, exported)
    return height - sum_out


def share_out(height: Counts, talus: Counts, share: float) -> Counts:
    """Return heights after one sweep of the proportional form; arguments as in :func:`relax`."""
    largest = np.zeros_like(height)
    total = np.zeros(height.shape, dtype=np.int64)
    for direction in DIRECTIONS:
        here, there = _pairs(height.shape, direction)
        limit = _slanted(talus if talus.ndim == 0 else talus[here], 0 not in direction)
        e = np.maximum(height[here] - height[there] - limit, 0)
        largest[here] = np.maximum(largest[here], e)
        total[here] += e
    gives = total > 0
    weight = np.zeros(height.shape, dtype=F)
    weight[gives] = F(share) * largest[gives].astype(F) / total[gives].astype(F)
    sum_out = np.zeros_like(height)
    for direction in DIRECTIONS:
        here, there = _pairs(height.shape, direction)
        d = height[here] - height[there]
        e = _excess(d, _limit(talus, here, there, d, 0 not in direction))
        donor = np.where(e > 0, weight[here], weight[there])
        sum_out[here] += (donor * e.astype(F)).astype(np.int32)
    return height - sum_out


def relax_mesh(
    height: Counts,
    volume: NDArray[np.int64],
    base: Counts,
    slope: NDArray[np.float32],
    graph: EdgeGraph,
    length: NDArray[np.float32],
    conductance: NDArray[np.float32],
    height_a_volume: NDArray[np.float32],
) -> tuple[Counts, NDArray[np.int64]]:
    """Return heights and volumes after one sweep over the edges of a mesh.

    Parameters
    ----------
    height, base
        Heights now and at the start, quanta, of shape (n,).
    volume
        Volume gained since the start, quanta of volume.
    slope
        Tangent of the talus angle of each vertex.
    graph
        Neighbours in compressed rows.
    length
        Horizontal length of each half-edge, quanta.
    conductance
        Quanta of volume that pass along each half-edge for each quantum of excess.
    height_a_volume
        Quanta of height for each quantum of volume, by vertex.
    """
    owner = np.repeat(np.arange(len(height)), np.diff(graph.start))
    d = height[owner] - height[graph.neighbor]
    upper = np.where(d > 0, slope[owner], slope[graph.neighbor])
    limit = (upper * length).astype(np.int32)
    flux = (conductance * _excess(d, limit).astype(F)).astype(np.int64)
    volume = volume.copy()
    np.subtract.at(volume, owner, flux)
    return base + (volume.astype(F) * height_a_volume).astype(np.int32), volume


def _excess(d: Counts, limit: Counts) -> Counts:
    return np.maximum(d - limit, 0) - np.maximum(-d - limit, 0)


def _limit(
    talus: Counts, here: tuple[slice, slice], there: tuple[slice, slice], d: Counts, slanted: bool
) -> Counts:
    axial = talus if talus.ndim == 0 else np.where(d > 0, talus[here], talus[there])
    return _slanted(axial, slanted)


def _slanted(axial: Counts, slanted: bool) -> Counts:
    return (axial.astype(F) * F(1.41421356)).astype(np.int32) if slanted else axial


def _pairs(
    shape: tuple[int, ...], direction: tuple[int, int]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return where a cell has a neighbour in this direction, and where that neighbour is."""
    here, there = [], []
    for size, step in zip(shape, direction, strict=True):
        here.append(slice(max(0, -step), size - max(0, step)))
        there.append(slice(max(0, step), size - max(0, -step)))
    return (here[0], here[1]), (there[0], there[1])


def _leave(
    height: Counts,
    talus: Counts,
    direction: tuple[int, int],
    share: np.float32,
    sum_out: Counts,
    exported: Counts,
) -> None:
    """Let material leave through the border where there is no neighbour in this direction."""
    opposite = (-direction[0], -direction[1])
    here, behind = _pairs(height.shape, opposite)
    outside = np.ones(height.shape, dtype=bool)
    outside[_pairs(height.shape, direction)[0]] = False
    d = height[behind] - height[here]
    limit = _slanted(talus if talus.ndim == 0 else talus[here], 0 not in direction)
    leaving = (share * np.maximum(d - limit, 0).astype(F)).astype(np.int32)
    leaving = np.where(outside[here], leaving, 0)
    sum_out[here] += leaving
    exported[here] += leaving
