"""What stays the same from step to step: the state to begin with, and every constant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrakit.quanta import Quanta
from terrakit_erosion.hydraulic.reference import (
    WALL,
    Counts,
    F,
    Floats,
    Flow,
    Ground,
    Pipe,
    Transfer,
    Turns,
    Window,
    ring,
)

BLOCK = 32
"""Steps after which every threshold of rounding was used once."""
GRAVITY = 9.81
CALMING = 0.2
"""Share of its last rise with which deep water is pushed as if it stood higher: the shortest waves
lose a third of their height with each push. Stable with a Courant number C up to 0.42, where
16 C^2 (1 + 2 CALMING) < 4."""
CALM_FROUDE = 0.5
"""Froude number up to which the flow need not be in balance with friction."""
EDGEWISE = 0.5 * (1.0 + 2.0**0.25)
"""How much too fast friction on each edge by itself lets water run, in the mean of both families:
the slope along a diagonal edge is 1 / sqrt(2) of that of a flow along an axis, and the other way
round. Within 4 % the same in every direction."""
SLIDE = 0.15
"""Share of what is beyond the talus that slides in a block of the longest steps."""
LARGEST = 1e30

_REVERSED = [int(f"{i:04b}"[::-1], 2) for i in range(BLOCK // 2)]
_TURN = [2 * _REVERSED[step >> 1] + (step & 1) for step in range(BLOCK)]


def turns(step: int) -> Turns:
    """Return where a step of a block rounds; each use goes through all values in its own order."""

    def of(first: int) -> np.float32:
        return F((_TURN[(step + first) % BLOCK] + 0.5) / BLOCK)

    return Turns(np.int32(_TURN[step]), of(6), of(14), of(22))


class Storms(NamedTuple):
    """The lattice of storms under the map."""

    cells: tuple[Counts, Counts]
    """Lattice index of each column and row."""
    parts: tuple[Floats, Floats]
    """Weight of the next lattice cell for each column and row."""
    seed: tuple[int, int]
    life: float
    """Seconds in which a storm gives way to the next."""


class Weather(NamedTuple):
    """What is the same in all steps of a block; counts of water a block, of every cell or one."""

    rain: Counts
    evaporation: Counts
    infiltration: Counts
    softness: Floats
    """Share of what the water could cut of the rock that it does; of every cell or one."""
    seconds: float
    """Time at which the block begins."""
    weight: np.float32
    """Share of this block in the means over the run."""


class Beginning:
    """What the run begins with; each field is handed over once, and forgotten.

    Parameters
    ----------
    bed, rock, depth
        Heights of ground and bedrock, and water, counts.
    ring
        Height and water of the inner ring of the frame, counts; see :func:`around`.
    wetness
        How wet the ground was, 0 to 1.
    """

    def __init__(
        self, bed: Counts, rock: Counts, depth: Counts, ring: tuple[Counts, Counts], wetness: Floats
    ) -> None:
        self._fields = {"bed": bed, "rock": rock, "depth": depth}
        self._ring = {"bed": ring[0], "rock": ring[0], "depth": ring[1]}
        self.wetness = wetness
        self.water = int(depth.sum(dtype=np.int64))

    def framed(self, name: str) -> Counts:
        """Return ``bed``, ``rock`` or ``depth`` with its frame."""
        inside = self._fields.pop(name)
        rows, cols = inside.shape
        field = np.full((rows + 5, cols + 4), 0 if name == "depth" else WALL, dtype=np.int32)
        field.reshape(-1)[ring(Window(rows, cols))] = self._ring[name]
        field[2:-3, 2:-2] = inside
        return field


@dataclass(frozen=True)
class Plan:
    """Everything a model needs to know."""

    quanta: Quanta
    water_quantum: float
    shift: int
    """Doublings from the quantum of water to that of heights."""
    spacing: float
    start: Counts
    """Heights before, counts."""
    seconds: float
    """Length of a step."""
    blocks: int
    flow: Flow | Pipe
    transfer: tuple[Transfer, Transfer]
    ground: Ground
    thin: int
    """Counts of water below which all load falls."""
    wet: int
    """Counts of water that make ground wet."""
    drowned: int
    """Counts of water that keep raindrops off the ground."""
    talus: int
    slide: float
    creep: float
    creep_sweeps: int
    round_the_map: bool
    leaves_the_map: bool
    varies: bool
    """Whether rain or softness is a field."""
    sea: NDArray[np.uint8] | None
    sea_surface: int
    storms: Storms | None
    springs: Counts | None
    """Counts of water a block that springs give."""
    wetting: np.float32

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the map."""
        rows, cols = self.start.shape
        return rows, cols

    @property
    def framed(self) -> tuple[int, int]:
        """Rows and columns with the frame, and the row that nothing reads."""
        return self.start.shape[0] + 5, self.start.shape[1] + 4

    def metres(self, water: Counts) -> Floats:
        """Return counts of water as metres."""
        metres: Floats = water.astype(np.float32) * np.float32(self.water_quantum)
        return metres

    @property
    def cell_area(self) -> float:
        """Area of a cell, m2."""
        return self.spacing**2


def constants(
    *,
    scheme: str,
    spacing: float,
    seconds: float,
    quanta: Quanta,
    water_quantum: float,
    manning: float,
    wave_depth: float,
    capacity: float,
    least_slope: float,
    threshold: float,
    rates: tuple[float, float],
    mixing: float,
) -> tuple[Flow | Pipe, tuple[Transfer, Transfer], Ground]:
    """Return the constants of the passes; what passes edges, along the axes and the diagonals."""
    bed, water = quanta.quantum, water_quantum
    slant = spacing * math.sqrt(2.0)
    friction = (EDGEWISE * manning) ** 2

    def narrow(value: float) -> np.float32:
        return F(min(value, LARGEST))

    slopes = [narrow(v) for v in (bed / spacing, water / spacing, bed / slant, water / slant)]
    speeds = narrow(spacing / seconds), narrow(slant / seconds)
    kick = 2 * GRAVITY * seconds  # pushed once in two steps
    flow: Flow | Pipe
    if scheme == "pipe":
        flow = Pipe(F(water), *slopes, narrow(kick * wave_depth), *speeds)
    else:
        flow = Flow(
            F(bed),
            F(water),
            *slopes,
            narrow(kick),
            narrow(4 * kick * friction),
            F(wave_depth),
            F(CALMING),
            narrow(1 / friction if friction > 0 else LARGEST),
            F(GRAVITY * CALM_FROUDE**2),
            *speeds,
        )
    spread = min(mixing * seconds / spacing**2, 0.125)
    transfers = []
    for length in (spacing, slant):
        share = spread * (spacing / length) ** 2
        transfers.append(Transfer(narrow(seconds / (length * water)), F(1 - 4 * share), F(share)))
    ground = Ground(
        narrow(slant * water / seconds),
        *slopes,
        F(water),
        F(manning),
        narrow(capacity / bed),
        F(least_slope),
        narrow(threshold),
        F(-math.expm1(-rates[0] * 2 * seconds)),
        F(-math.expm1(-rates[1] * 2 * seconds)),
    )
    return flow, (transfers[0], transfers[1]), ground


def around(
    border: str,
    start: Counts,
    spacing: float,
    bed_quantum: float,
    shift: int,
    level: float | None,
    sea: NDArray[np.uint8] | None,
) -> tuple[Counts, Counts]:
    """Return ground and water of the ring around the map, in the order of ``reference.ring``.

    Closed, and beside the sea: a wall. Open: the ground falls on beyond the edge as it does before
    it, between 1 in 50 and 1 in 1, and is dry. Fixed: it goes on level, under water up to ``level``
    (in counts).
    """
    rows, cols = start.shape
    row, col = np.divmod(ring(Window(rows, cols)), cols + 4)
    at_edge = np.clip(row - 2, 0, rows - 1), np.clip(col - 2, 0, cols - 1)
    before = np.clip(row - 2, 1, rows - 2), np.clip(col - 2, 1, cols - 2)
    bed = np.full(len(row), WALL, dtype=np.int32)
    depth = np.zeros_like(bed)
    if border in ("closed", "periodic"):
        return bed, depth
    edge = start[at_edge].astype(np.int64)
    if border == "open":
        step = round(min(spacing / bed_quantum, 2**28))
        bed[:] = edge - np.clip(start[before] - edge, max(1, step // 50), step)
    else:
        bed[:] = edge
        if level is not None:
            above = np.clip(np.floor(level) - edge, 0, 2**29 >> shift)
            depth[:] = above.astype(np.int64) << shift
    if sea is not None:
        beside = sea[at_edge] != 0
        bed[beside], depth[beside] = WALL, 0
    return bed, depth
