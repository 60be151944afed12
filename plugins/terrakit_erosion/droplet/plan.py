"""What stays the same from batch to batch, in the units in which drops reckon."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.quanta import Quanta

PARTS = 64
"""Parts in a quantum of height, in which drops take and give."""
MOST = 2.0**28
"""Parts that one drop may carry."""
NO_WATER = -(2**30)
"""Level of lakes and sea where there is none, quanta."""
COUNTS = 16.0
"""Smoothed visits are in sixteenths."""

(
    KEEP,
    RISE,
    SPEED_KEPT,
    SPEED_GAINED,
    CAPACITY,
    LEAST_SLOPE,
    TAKEN,
    SETTLED,
    WATER_KEPT,
    WATER,
    DIP,
    BITE,
    ENERGY,
) = range(13)
"""Places in the list of settings, as in ``droplet.cl``."""

DRY, NORTH, SOUTH, WEST, EAST, SEA, GOES_ON = range(7)
"""How a walk ends; all but the last are places where loads are booked."""
SINKS = ("wash load", "border north", "border south", "border west", "border east", "sea")
"""What the ledger calls them."""


@dataclass(frozen=True)
class Plan:
    """What a model needs to know; heights in quanta, amounts in parts, ways in steps."""

    start: NDArray[np.int32]
    loose: NDArray[np.int32]
    outlet: NDArray[np.uint8]
    quanta: Quanta
    settings: NDArray[np.float32]
    spread: NDArray[np.float32]
    """Weights of the brush by distance, in samples, along one axis."""
    share: NDArray[np.float32]
    """Weights with which visits count, 1 in the middle."""
    seed: tuple[int, int]
    batches: int
    tall: int
    """Drops of a batch from north to south; each falls in its own part of the map."""
    wide: int
    """Drops of a batch from west to east."""
    steps: int
    patience: int
    sea: int
    crosses: bool
    refresh: int
    """Batches between two looks for the way out of hollows."""
    is_open: bool
    is_laid_down: bool
    is_hard: bool
    sweeps: int
    """Sweeps after a batch in which banks slump and plains level out."""
    bank: tuple[int, int]
    """Difference to an axial and a diagonal neighbour that stands, quanta."""
    slumps: float
    levels: float
    shield: float
    """Most that a batch takes from a place, over the fall to its steepest neighbour."""

    @property
    def batch(self) -> int:
        """How many drops run at once."""
        return self.tall * self.wide


def brush(radius: float) -> tuple[NDArray[np.float32], NDArray[np.float32], float]:
    """Return the weights of the brush, those of visits, and the area of the brush.

    The brush is a Gaussian with the spread of a cone of this radius (in samples): 0.15 of the
    radius squared along each axis, of which sharing among four corners already gives 1/6. The area
    is the volume that raises its middle by 1.
    """
    variance = 0.15 * radius * radius
    weights = _gaussian(variance - 1.0 / 6.0)
    total = weights[0] + 2.0 * weights[1:].sum()
    return (
        (weights / total).astype(np.float32),
        _gaussian(variance).astype(np.float32),
        2.0 * math.pi * variance,
    )


def _gaussian(variance: float) -> NDArray[np.float64]:
    deviation = math.sqrt(max(variance, 0.01))
    away = np.arange(max(1, math.ceil(2.6 * deviation)) + 1)
    weights = np.exp(-0.5 * (away / deviation) ** 2)
    return np.where(weights < 1e-6, 0.0, weights)
