"""Heights as integers: the fixed point in which erosion adds and subtracts.

A float32 near 1000 m changes in steps of 0.06 mm and forgets what is smaller; sums of it depend
on their order. Erosion therefore works on int32 counts of a quantum, a power of two of metres that
follows from the spacing alone (so that tiles agree): additions are exact, their order does not
matter, and a ledger closes to the last quantum. Only what changed is written back, so ground that
nothing touched keeps its bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from terrakit.heightfield import Field

FINENESS = 18
"""A quantum is the spacing, rounded down to a power of two, divided by two this often."""
LIMIT = 2**29
"""Largest count for a height, so that the difference of two heights stays an int32."""


@dataclass(frozen=True)
class Quanta:
    """How heights are counted: ``height = (datum + count) * quantum``, metres.

    Every conversion is exact integer work or one correctly rounded operation, so that a kernel
    that does the same gets the same bits.
    """

    quantum: float
    datum: int

    @classmethod
    def fitting(cls, elevation: Field, spacing: float, headroom: float = 0.0) -> Quanta:
        """Return the quantum for a terrain of this spacing and relief.

        Parameters
        ----------
        elevation
            Heights, metres.
        spacing
            Distance between neighbouring samples, metres.
        headroom
            Metres by which heights may grow or shrink during the run.
        """
        low, high = float(elevation.min()), float(elevation.max())
        quantum = 2.0 ** (math.floor(math.log2(spacing)) - FINENESS)
        middle = 0.0
        reach = max(abs(low), abs(high)) + headroom
        if reach >= LIMIT * quantum:  # far from the datum: move the datum, then coarsen
            middle = 0.5 * (low + high)
            reach = 0.5 * (high - low) + headroom + 1.0
        while reach >= LIMIT * quantum:
            quantum *= 2.0
        return cls(quantum, round(middle / quantum))

    def count(self, elevation: Field) -> NDArray[np.int32]:
        """Return heights as counts, rounded to the nearest quantum."""
        return self.count_exactly(elevation.astype(np.float64))

    def count_exactly(self, heights: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return float64 heights as counts, rounded to the nearest quantum."""
        counts = np.rint(heights / self.quantum).astype(np.int64)
        return (counts - self.datum).astype(np.int32)

    def height(
        self, before: Field, start: NDArray[np.int32], end: NDArray[np.int32]
    ) -> NDArray[np.float32]:
        """Return the heights after a run: bit for bit ``before`` where the count did not change."""
        after = (end.astype(np.int64) + self.datum) * self.quantum
        return np.where(start == end, before, after.astype(np.float32))

    def metres(self, counts: NDArray[np.int32] | NDArray[np.int64]) -> NDArray[np.float32]:
        """Return differences of counts as metres."""
        return (counts * np.float64(self.quantum)).astype(np.float32)

    def volume(self, counts: NDArray[np.int32], cell_area: float) -> float:
        """Return the volume (m3) between the plane at 0 m and cells of equal area."""
        total = int(counts.sum(dtype=np.int64)) + counts.size * self.datum
        return total * self.quantum * cell_area
