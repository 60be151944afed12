"""Creep of hillslopes in NumPy: the readable definition, and the oracle of ``hillslope.cl``.

Beyond a closed border lies a mirror: every cell has eight neighbours, and one outside the map is as
high as the cell of the border beside it. Beyond an open or a fixed border the slope goes on.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
STEEPEST = F(0.9)
"""Largest square of the slope, relative to the critical one: creep is up to 10 times as fast."""
UNSURE = 16
"""Quanta that truncation may hide of what creeps out of a cell."""
CAUTIOUS = F(1 - 2.0**-20)
"""Keeps what a cell gives away below what it has, however the factors round."""
DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))


def hasten(height: Counts, base: Floats, steepness: float, border: str) -> Floats:
    """Return how fast soil creeps on the slope of each cell (Roering 1999).

    Parameters
    ----------
    height
        Heights of shape (rows, cols), quanta.
    base
        Rate on flat ground, relative to the fastest.
    steepness
        Slope of one quantum to an axial neighbour, relative to the critical slope; 0 for linear
        creep.
    border
        ``closed``, ``open`` or ``fixed``.
    """
    beyond = "edge" if border == "closed" else "reflect"  # squares do not tell up from down
    around = np.pad(height, 1, mode=beyond)  # type: ignore[call-overload]
    squares = []
    for there in (
        (slice(0, -2), slice(1, -1)),
        (slice(2, None), slice(1, -1)),
        (slice(1, -1), slice(0, -2)),
        (slice(1, -1), slice(2, None)),
    ):
        slope = (around[there] - height).astype(F) * F(steepness)
        squares.append(slope * slope)
    square = F(0.5) * ((squares[0] + squares[1]) + (squares[2] + squares[3]))
    hastened: Floats = base / (F(1) - np.minimum(square, STEEPEST))
    return hastened


def hold(
    height: Counts,
    bed: Counts,
    rate: Floats,
    softness: Floats,
    shares: tuple[float, float],
    border: str,
) -> Floats:
    """Return the share of what would creep out of a cell that it gives.

    That is what its loose material can supply or, if that is more, what its bedrock allows; the
    arguments are those of :func:`creep`, and ``softness`` is what the bedrock allows.
    """
    out = np.zeros_like(height)
    for flux in _wanted(height, rate, shares):
        out += np.where(flux > 0, flux + F(0.5), F(0)).astype(np.int32)
    if border == "open":
        for _, cells, d in _outward(height):
            out[cells] += sum(_leaving(rate[cells], d, shares, None))
    wanted = (out + np.int32(UNSURE)).astype(F)
    there = (height - bed).astype(F)
    scarce = there < wanted
    supplied = np.where(scarce, there / wanted * CAUTIOUS, F(1))
    return np.maximum(supplied, softness).astype(F)


def creep(
    height: Counts,
    bed: Counts,
    rate: Floats,
    weight: Floats | None,
    shares: tuple[float, float],
    border: str,
    exported: NDArray[np.int64],
) -> Counts:
    """Return heights after one sweep.

    Parameters
    ----------
    height
        Heights of shape (rows, cols), quanta.
    bed
        Height of the bedrock under loose material; lowered in place where the ground falls below.
    rate
        How fast soil creeps in each cell, relative to ``shares``.
    weight
        Share of it that the higher cell gives; None for all.
    shares
        Share of the difference that passes to an axial and to a diagonal neighbour.
    border
        ``closed``; ``open``, over which material leaves down the slope that goes on; or ``fixed``,
        where heights are held.
    exported
        What left through north, south, west and east, along each; changed in place.
    """
    sum_out = np.zeros_like(height)
    padded = None if weight is None else np.pad(weight, 1, mode="edge")
    around = np.pad(height, 1, mode="edge")
    for (dr, dc), flux in zip(DIRECTIONS, _wanted(height, rate, shares), strict=True):
        giver = None
        if padded is not None and weight is not None:
            there = _shifted(height.shape, dr, dc)
            giver = np.where(height > around[there], weight, padded[there])
        sum_out += _given(giver, flux)
    if border == "open":
        for side, cells, d in _outward(height):
            own = None if weight is None else weight[cells]
            leaving = sum(_leaving(rate[cells], d, shares, own))
            exported[side, : d.size] += np.ravel(leaving)
            sum_out[cells] += leaving
    elif border == "fixed":
        exported[0, : height.shape[1]] -= sum_out[0]
        exported[1, : height.shape[1]] -= sum_out[-1]
        exported[2, 1 : height.shape[0] - 1] -= sum_out[1:-1, 0]
        exported[3, 1 : height.shape[0] - 1] -= sum_out[1:-1, -1]
        sum_out[[0, -1], :] = 0
        sum_out[:, [0, -1]] = 0
    after = height - sum_out
    np.minimum(bed, after, out=bed)
    return after


def _wanted(height: Counts, rate: Floats, shares: tuple[float, float]) -> Iterator[Floats]:
    """Yield, for each direction, what would creep to the neighbour there."""
    around, rates = np.pad(height, 1, mode="edge"), np.pad(rate, 1, mode="edge")
    for dr, dc in DIRECTIONS:
        there = _shifted(height.shape, dr, dc)
        share = F(shares[dr != 0 and dc != 0])
        between = F(0.5) * (rate + rates[there])
        yield share * between * (height - around[there]).astype(F)


def _shifted(shape: tuple[int, ...], dr: int, dc: int) -> tuple[slice, slice]:
    rows, cols = shape
    return slice(1 + dr, 1 + dr + rows), slice(1 + dc, 1 + dc + cols)


def _outward(height: Counts) -> Iterator[tuple[int, tuple[slice, slice], Counts]]:
    """Yield, for each side, its number, its cells and how far they lie below those behind."""
    whole = slice(None)
    for side, (first, inner) in enumerate(
        (
            ((slice(0, 1), whole), (slice(1, 2), whole)),
            ((slice(-1, None), whole), (slice(-2, -1), whole)),
            ((whole, slice(0, 1)), (whole, slice(1, 2))),
            ((whole, slice(-1, None)), (whole, slice(-2, -1))),
        )
    ):
        yield side, first, np.maximum(height[inner] - height[first], 0)


def _leaving(
    rate: Floats, d: Counts, shares: tuple[float, float], weight: Floats | None
) -> tuple[Counts, Counts]:
    """Return what goes to the axial neighbour beyond a border, and to both diagonal ones."""
    parts = []
    for share in shares:
        flux = F(share) * (F(0.5) * (rate + rate)) * d.astype(F)
        parts.append(_given(weight, flux))
    return parts[0], np.int32(2) * parts[1]


def _given(weight: Floats | None, flux: Floats) -> Counts:
    """Return a flux in whole quanta: the nearest to all of it, and of less no more than that."""
    nearest = np.where(flux < 0, F(-0.5), F(0.5))
    if weight is None:
        return (flux + nearest).astype(np.int32)
    return (weight * flux + np.where(weight < F(1), F(0), nearest)).astype(np.int32)
