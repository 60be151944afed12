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
    State,
    Transfer,
    Turns,
)

BLOCK = 32
"""Steps after which every threshold of rounding was used once."""
GRAVITY = 9.81
CALM_FROUDE = 0.5
"""Froude number up to which the flow need not be in balance with friction."""
SLIDE = 0.15
"""Share of what is beyond the talus that slides, once a block."""
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


@dataclass(frozen=True)
class Plan:
    """Everything a model needs to know."""

    quanta: Quanta
    water_quantum: float
    shift: int
    """Doublings from the quantum of water to that of heights."""
    spacing: float
    start: Counts
    rock: Counts
    depth: Counts
    """Heights of the ground and of the bedrock, and water, without the frame, counts."""
    frame_bed: Counts
    frame_depth: Counts
    """The frame; what is within it does not count."""
    seconds: float
    """Length of a step."""
    blocks: int
    flow: Flow | Pipe
    transfer: tuple[Transfer, Transfer]
    ground: tuple[Ground, Ground]
    thin: int
    talus: int
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
    wetness: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the map."""
        rows, cols = self.start.shape
        return rows, cols

    @property
    def framed(self) -> tuple[int, int]:
        """Rows and columns with the frame, and the row that nothing reads."""
        return self.start.shape[0] + 5, self.start.shape[1] + 4

    @property
    def cell_area(self) -> float:
        """Area of a cell, m2."""
        return self.spacing**2

    def frame(self, inside: Counts, outside: Counts | int) -> Counts:
        """Return a field with its frame."""
        framed = np.empty(self.framed, dtype=inside.dtype)
        framed[:] = outside
        framed[2:-3, 2:-2] = inside
        return framed

    def state(self) -> State:
        """Return what the run begins with."""
        return State(
            self.frame(self.start, self.frame_bed),
            self.frame(self.depth, self.frame_depth),
            np.zeros(self.framed, dtype=np.int32),
        )


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
) -> tuple[Flow | Pipe, tuple[Transfer, Transfer], tuple[Ground, Ground]]:
    """Return the constants of both passes, along the axes and the diagonals."""
    bed, water = quanta.quantum, water_quantum
    slant = spacing * math.sqrt(2.0)
    friction = manning**2

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
            narrow(1 / friction if friction > 0 else LARGEST),
            F(GRAVITY * CALM_FROUDE**2),
            *speeds,
        )
    spread = min(mixing * seconds / spacing**2, 0.125)
    transfers, grounds = [], []
    for length in (spacing, slant):
        rate = seconds / (length * water)
        share = spread * (spacing / length) ** 2
        transfers.append(Transfer(narrow(rate), F(1 - 4 * share), F(share)))
        grounds.append(
            Ground(
                narrow(bed / length),
                narrow(water / length),
                F(water),
                narrow(manning / rate),
                narrow(capacity / (rate * bed)),
                F(least_slope),
                narrow(threshold * rate),
                F(-math.expm1(-rates[0] * seconds)),
                F(-math.expm1(-rates[1] * seconds)),
            )
        )
    return flow, (transfers[0], transfers[1]), (grounds[0], grounds[1])


def frames(
    border: str, start: Counts, spacing: float, bed_quantum: float, shift: int, level: float | None
) -> tuple[Counts, Counts]:
    """Return bed and water of the frame.

    Closed: a wall. Open: the ground falls on beyond the edge as it does before it, between 1 in 50
    and 1 in 1, and is dry. Fixed: it goes on level, under water up to ``level`` (in counts).
    """
    rows, cols = start.shape
    bed = np.full((rows + 5, cols + 4), WALL, dtype=np.int32)
    depth = np.zeros_like(bed)
    if border in ("closed", "periodic"):
        return bed, depth
    inner = start[1:-1, 1:-1]
    once = np.pad(start, 1, mode="edge")
    if border == "open":
        step = round(min(spacing / bed_quantum, 2**28))
        before = np.pad(inner, 2, mode="edge")
        drop = np.clip(before.astype(np.int64) - once, max(1, step // 50), step)
        beyond = (once - drop).astype(np.int32)
    else:
        beyond = once
    framed = bed[1 : rows + 3, 1 : cols + 3]
    ring = np.ones(framed.shape, dtype=bool)
    ring[1:-1, 1:-1] = False
    framed[ring] = beyond[ring]
    if border == "fixed" and level is not None:
        above = np.clip(np.floor(level) - once.astype(np.float64), 0, 2**29 >> shift)
        depth[1 : rows + 3, 1 : cols + 3][ring] = (above[ring].astype(np.int64) << shift).astype(
            np.int32
        )
    return bed, depth
