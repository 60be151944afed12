"""The automaton in NumPy: the readable definition, and the oracle of ``automaton.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
HIGHEST_DROP = 2**27
"""Largest difference of two levels that counts, quanta, so that eight of them fit an int32."""
ALMOST = 0.99999905
"""Share of what may flow that does, so that rounding never gives away more than there is."""


class NumpyModel:
    """State of the automaton, heights in quanta.

    Parameters
    ----------
    bedrock, loose
        Height of the bedrock and thickness of what lies loose on it.
    rates
        Solubility, evaporated share and saturation.
    is_open
        Whether water and load may leave over the border.
    device
        Taken for the sake of the OpenCL twin.
    """

    def __init__(
        self,
        bedrock: Counts,
        loose: Counts,
        rates: tuple[float, float, float],
        is_open: bool,
        device: object = None,
    ) -> None:
        del device
        self.bedrock, self.loose = bedrock.copy(), loose.copy()
        self.water, self.load = np.zeros_like(bedrock), np.zeros_like(bedrock)
        self.rates = tuple(F(rate) for rate in rates)
        self.is_open = is_open
        self._exported = np.zeros(bedrock.shape, dtype=np.int64)

    def step(self, rain: Counts, softness: Floats) -> None:
        """Let it rain and dissolve, share water and load out, evaporate and lay down."""
        solubility, evaporated, saturation = self.rates
        self.water += rain
        wanted = (solubility * self.water.astype(F)).astype(np.int32)
        of_loose = np.minimum(wanted, self.loose)
        of_bed = (softness * (wanted - of_loose).astype(F)).astype(np.int32)
        self.bedrock -= of_bed
        self.loose -= of_loose
        self.load += of_loose + of_bed
        self._flow(self.bedrock + self.loose + self.water)
        self.water -= (evaporated * self.water.astype(F)).astype(np.int32)
        holds = np.minimum(saturation * self.water.astype(F), F(2147483520)).astype(np.int32)
        dropped = np.maximum(self.load - holds, 0)
        self.load -= dropped
        self.loose += dropped

    def _flow(self, level: Counts) -> None:
        """Give water and load to lower neighbours, in proportion to the drops."""
        total, lower = np.zeros_like(level), np.zeros_like(level)
        for direction in DIRECTIONS:
            here, there = pairs(level.shape, direction)
            below = np.maximum(_drop(level[here], level[there]), 0)
            total[here] += below
            lower[here] += below > 0
            if self.is_open:
                beyond = self._beyond(level, direction)
                total += beyond
                lower += beyond > 0
        water = self.water.astype(F)
        moved = np.minimum(water, total.astype(F) / (lower + 1).astype(F)) * F(ALMOST)
        gives = np.where(total > 0, moved / np.maximum(total, 1).astype(F), F(0))
        thickness = self.load.astype(F) / np.maximum(water, F(1))
        carries = np.where(self.water > 0, gives * thickness, F(0))
        for store, share in ((self.water, gives), (self.load, carries)):
            out = np.zeros_like(level)
            for direction in DIRECTIONS:
                here, there = pairs(level.shape, direction)
                drop = _drop(level[here], level[there])
                donor = np.where(drop > 0, share[here], share[there])
                out[here] += (donor * drop.astype(F)).astype(np.int32)
                if self.is_open:
                    leaving = (share * self._beyond(level, direction).astype(F)).astype(np.int32)
                    out += leaving
                    if store is self.load:
                        self._exported += leaving
            store -= out

    def _beyond(self, level: Counts, direction: tuple[int, int]) -> Counts:
        """Return the drop over the open border: that from the opposite neighbour, going on."""
        outside = np.ones(level.shape, dtype=bool)
        outside[pairs(level.shape, direction)[0]] = False
        here, behind = pairs(level.shape, (-direction[0], -direction[1]))
        drop = np.zeros_like(level)
        drop[here] = np.maximum(_drop(level[behind], level[here]), 0)
        return np.where(outside, drop, 0)

    def ground(self) -> tuple[Counts, Counts]:
        """Return bedrock and loose ground with what is still dissolved laid down on it."""
        return self.bedrock, self.loose + self.load

    def exported(self) -> tuple[int, int, int, int]:
        """Return the load that left through the northern, southern, western, eastern border."""
        gone = self._exported
        sides = (gone[0], gone[-1], gone[1:-1, 0], gone[1:-1, -1])
        north, south, west, east = (int(side.sum()) for side in sides)
        return north, south, west, east


def pairs(
    shape: tuple[int, ...], direction: tuple[int, int]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return where a cell has a neighbour in this direction, and where that neighbour is."""
    here, there = [], []
    for size, step in zip(shape, direction, strict=True):
        here.append(slice(max(0, -step), size - max(0, step)))
        there.append(slice(max(0, step), size - max(0, -step)))
    return (here[0], here[1]), (there[0], there[1])


def _drop(above: Counts, below: Counts) -> Counts:
    return np.clip(above - below, -HIGHEST_DROP, HIGHEST_DROP)
