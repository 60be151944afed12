"""A tree of flow cut into paths, so that it can be swept from the outlets up in parallel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from numpy.typing import NDArray

from terrakit.compute import DeviceArray

ArrayT = TypeVar("ArrayT", NDArray[Any], DeviceArray)


@dataclass(frozen=True)
class Paths(Generic[ArrayT]):
    """Paths along main donors, by level.

    Every cell belongs to one path. A path begins at its head, its downstream end, and follows the
    main donors, those with the largest drainage area, up to a source. The receiver of a head is on
    a path of an earlier level; paths of one level do not depend on each other. There are at most
    log2(cells) + 1 levels.
    """

    main_donor: ArrayT
    """Number of the main donor of each cell, or -1 at a source; int32 (rows, cols)."""
    heads: ArrayT
    """Numbers of the cells at the downstream ends of the paths, level by level; int32."""
    offsets: tuple[int, ...]
    """Level k is ``heads[offsets[k]:offsets[k + 1]]``."""


@dataclass(frozen=True)
class Routing(Generic[ArrayT]):
    """Where the water of each cell goes: a forest whose roots are the outlets."""

    receiver: ArrayT
    """Number (row * cols + col) of the neighbour that takes the water; int32 (rows, cols)."""
    area: ArrayT
    """Number of cells that drain through each cell, itself included; int32 (rows, cols)."""
    paths: Paths[ArrayT]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, cols = self.receiver.shape
        return rows, cols
