"""Stream power in NumPy: the readable definition, and the oracle of ``stream_power.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.routing import Routing, reference

F = np.float32
NEWTON_STEPS = 6
STEEPEST = F(0.75)
"""Square of the slope, relative to the critical one, up to which creep grows: to 4 times."""
Counts = NDArray[np.int32]
HALF = tuple((dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0))


def incise(
    routing: Routing[NDArray[np.int32]],
    outlet: NDArray[np.uint8],
    before: Counts,
    incised: NDArray[np.int64],
    erodibility: NDArray[np.float32],
    uplift: Counts,
    constants: tuple[float, float, float, float, float],
) -> Counts:
    """Return heights after uplift and one implicit step of stream power.

    Parameters
    ----------
    routing
        Where the water goes.
    outlet
        Not 0 where the height is held.
    before
        Heights, quanta.
    incised
        What streams removed so far, quanta; added to in place.
    erodibility
        K dt of every cell, or one number.
    uplift
        Rise in this step, quanta, of every cell, or one number.
    constants
        Cell area (m2), area exponent, slope exponent, spacing (m), quantum (m).
    """
    cell_area, area_exponent, slope_exponent, spacing, quantum = constants
    cols = before.shape[1]
    receiver = routing.receiver.ravel()
    discharge = exact.power(routing.area.ravel().astype(F) * F(cell_area), area_exponent)
    discharge = np.minimum(discharge, F(1e28))
    strength = np.broadcast_to(erodibility, before.shape).ravel() * discharge
    after = before.ravel() + np.broadcast_to(uplift, before.shape).ravel()
    held = outlet.ravel() != 0
    after[held] = before.ravel()[held]
    removed = incised.reshape(-1)
    for cells in reference.generations(receiver)[1:]:
        cells = cells[~held[cells]]
        below = receiver[cells]
        drop = after[cells] - after[below]
        cells, below, drop = (a[drop > 1] for a in (cells, below, drop))
        step = np.abs(cells - below)
        near = (step == 1) | (step == cols)
        length = np.where(near, F(spacing), F(spacing) * F(1.41421356))
        left = _left(drop, strength[cells], length, slope_exponent, quantum)
        lowest = after[below] + np.maximum(left, 1)
        removed[cells] += after[cells] - lowest
        after[cells] = lowest
    return after.reshape(before.shape)


def diffuse(
    height: Counts,
    outlet: NDArray[np.uint8],
    received: NDArray[np.int64],
    shares: tuple[float, float, float, float],
) -> Counts:
    """Return heights after one sweep of hillslope diffusion.

    Parameters
    ----------
    height
        Heights, quanta.
    outlet
        Not 0 where the height is held: such cells take and never give.
    received
        What held cells took so far, quanta; added to in place.
    shares
        Share of the difference that passes to an axial and to a diagonal neighbour, and the slope
        of one quantum, relative to the critical slope, to an axial and a diagonal neighbour (0 for
        linear diffusion).
    """
    axial, diagonal, axial_slope, diagonal_slope = shares
    sum_out = np.zeros_like(height)
    held = outlet != 0
    rows, cols = height.shape
    for dr, dc in HALF:
        here = slice(max(0, -dr), rows - max(0, dr)), slice(max(0, -dc), cols - max(0, dc))
        there = slice(max(0, dr), rows - max(0, -dr)), slice(max(0, dc), cols - max(0, -dc))
        slanted = dr != 0 and dc != 0
        d = height[here] - height[there]
        if slanted:
            flux = _creep(d, F(diagonal), diagonal_slope)
        else:  # along the border, in place of the diagonal that it lacks, as in a mirror
            edge = np.zeros((rows, 1) if dr == 0 else (1, cols), dtype=F)
            edge.flat[[0, -1]] = F(diagonal)
            flux = _creep(d, F(axial) + edge, axial_slope)
        gives_to_none = (held[here] & (d > 0)) | (held[there] & (d < 0))
        sum_out[here] += np.where(gives_to_none, 0, flux)
    received[held] -= sum_out[held]
    return np.where(held, height, height - sum_out)


def _left(
    drop: Counts,
    strength: NDArray[np.float32],
    length: NDArray[np.float32],
    exponent: float,
    quantum: float,
) -> Counts:
    """Return the height that is left of a drop to the receiver, quanta."""
    if exponent == 1.0:
        g = strength / length
        return drop - (drop.astype(F) * (g / (F(1) + g))).astype(np.int32)
    n = F(exponent)
    whole = drop.astype(F) * F(quantum) / length
    g = np.minimum(strength / length, F(1e25))
    # Each of the two terms alone gives an upper bound, the lower of which is close
    s = exact.power(whole / np.maximum(g, F(1e-20)), float(F(1) / n))
    s = np.minimum(np.maximum(s, F(1e-6)), whole)
    for _ in range(NEWTON_STEPS):
        p = g * exact.power(s, exponent)
        following = s - (s + p - whole) / (F(1) + n * p / s)
        s = np.minimum(np.maximum(following, F(0.1) * s), whole)
    return drop - (drop.astype(F) * ((whole - s) / whole)).astype(np.int32)


def _creep(d: Counts, share: np.float32 | NDArray[np.float32], slope_of_quantum: float) -> Counts:
    if slope_of_quantum <= 0:
        return (share * d.astype(F)).astype(np.int32)
    s = d.astype(F) * F(slope_of_quantum)
    rate = share / (F(1) - np.minimum(s * s, STEEPEST))
    return (rate * d.astype(F)).astype(np.int32)
