"""What the wind does in a run: how strong it is, when it turns, how far grains hop."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute.exact import mix
from terrakit.heightfield import Grid
from terrakit.noise import BASES
from terrakit.quanta import Quanta

YEAR = 365.25 * 86400.0
FRICTION = 0.4 / math.log(10.0 / 1e-3)
"""Friction velocity over wind speed 10 m above sand whose roughness is 1 mm (law of the wall)."""
THRESHOLD_SPEED = 5.5
"""Wind, m/s 10 m above ground, in which sand begins to move."""
LETTAU = 6.7 * 1.22 / 9.81 / 1650.0
"""Bulk volume of sand that moves (Lettau & Lettau 1978), s2/m: 6.7 rho_air / g / rho_sand."""

MOST_STRESS = 2.25
"""Of that on level ground: what relief can raise it to."""
GUST = 0.1
"""Sand that one gust moves over a line where the stress is highest, in squares of the spacing."""
SLIDE = 0.3
"""Share of what is steeper than the talus that slides in one gust; the scheme stays monotone."""
CREEP = 0.005
"""Share of any difference of height that grains level by rolling, in one gust."""
LAG = 4.5
"""Degrees below the talus angle at which slides stop: fed from above, slip faces stay at it."""
ON_ROCK, ON_SAND = 0.2, 0.8
"""Share of the flying sand that lands for good after one hop."""
COVER = 0.1
"""Metres of sand on which grains no longer feel the rock."""
SHELTER = 0.4
"""Metres below the wind's stream at which nothing is lifted any more."""
FLIGHT = 2.0
"""Metres above its surroundings where rock feels half of the grains."""
PRESS, CALM, RISE = 2.5, 0.5, 1.8
"""Stress for a unit of relief over length: on what stands out, in hollows (a share), on slopes."""
STEEPEST = 0.25
"""Most stress that a slope adds: on steeper ones the theory, which is linear, ends."""
SPREAD = math.radians(8.0)
"""How far gusts stray from the wind's direction."""
REFRESH = 8
"""Gusts until stress is computed anew: dunes are slow."""
FEWEST_GUSTS = 128
DUNE_SHADOWS = 200.0
"""Metres that shadows of dunes still to come may reach, besides those of the first relief."""
SCALES = 40.0
"""Hops that the longest relief measures which the wind feels."""


@dataclass(frozen=True)
class Laws:
    """Numbers of the kernel ``wind_blow`` that stay the same in a run; see ``wind.cl``."""

    talus: int
    talus_slanted: int
    axial: float
    slanted: float
    creep_axial: float
    creep_slanted: float
    on_rock: float
    on_sand: float
    per_cover: float
    per_shelter: float


@dataclass(frozen=True)
class Level:
    """One spline along the wind, and the stress for what it takes off."""

    down: int
    right: int
    down_twice: int
    right_twice: int
    weight: float


@dataclass(frozen=True)
class Blow:
    """Numbers of the kernel ``wind_lift`` for one direction of the wind."""

    rise: tuple[float, float]
    climb: tuple[float, float]
    aside: tuple[float, float]
    across: tuple[int, int]
    """Cell beside the path, to which sand veers."""
    levels: tuple[Level, ...]
    shadows: tuple[tuple[int, int, int], ...]
    """Steps by which shadows lengthen, each twice the last: cells, and quanta that they sink."""


@dataclass(frozen=True)
class Gust:
    """Where all sand hops to, cells."""

    down: int
    right: int


@dataclass(frozen=True)
class Plan:
    """Everything that stays the same in a run; heights in quanta, lengths in metres."""

    quanta: Quanta
    spacing: float
    shape: tuple[int, int]
    periodic: bool
    deflection: float
    gusts: int
    winds: tuple[tuple[float, float], ...]
    """Directions, degrees, and the share of time up to the end of each."""
    gusts_a_cycle: int
    hop: float
    shadow_slope: float
    longest_shadow: float
    laws: Laws
    lifted: float
    """Quanta that a gust lifts where stress is 1, over what the root of stress is above the
    threshold."""
    threshold: float
    """Root of the stress at which sand begins to move."""
    inflow: int
    wears: float
    """Quanta of rock for a quantum that flies, until stress is computed anew."""
    dusty: float
    """Share of worn rock that leaves as dust."""
    height_rate: float
    """Speed-up for each quantum of height."""
    lowest: float
    seed: tuple[int, int]

    @property
    def near(self) -> tuple[int, ...]:
        """Steps of the splines that take grain-sized relief off, cells."""
        return self._steps(0, 1.4 * self.hop) or (1,)

    @property
    def wide(self) -> tuple[int, ...]:
        """Steps of further splines: what a hillside is, where that is asked for."""
        if not (self.wears or self.deflection):
            return ()
        return self._steps(len(self.near), 12.0 * self.hop)

    def _steps(self, first: int, longest: float) -> tuple[int, ...]:
        """Return powers of two, of cells, as long as twice of them fits the map."""
        steps = []
        reach = 2**first
        while reach * self.spacing <= longest and 2 * reach < min(self.shape):
            steps.append(reach)
            reach *= 2
        return tuple(steps)

    def _along(self, direction: float, longest: float, times: int) -> tuple[int, ...]:
        """Return powers of two, of cells along the wind, as long as so many of them fit the map."""
        south, east = towards(direction)
        rows, cols = self.shape
        steps = []
        reach = 1
        while (
            reach * self.spacing <= longest
            and round(times * abs(south) * reach) < rows
            and round(times * abs(east) * reach) < cols
        ):
            steps.append(reach)
            reach *= 2
        return tuple(steps)

    def wind_of(self, gust: int) -> float:
        """Return the direction that the wind comes from."""
        moment = (gust % self.gusts_a_cycle + 0.5) / self.gusts_a_cycle
        return next(angle for angle, until in self.winds if moment < until)

    def blow(self, direction: float) -> Blow:
        """Return the numbers for one direction."""
        south, east = towards(direction)
        slope = self.quanta.quantum / (2 * self.spacing)
        rows_lie_across = abs(east) >= abs(south)
        shift = self.hop / self.spacing * slope * self.deflection
        along = east if rows_lie_across else -south  # of a step across, what counts as one
        shift = -shift / along
        levels = []
        for step in self._along(direction, SCALES * self.hop, 2):
            size = step * self.spacing
            levels.append(
                Level(
                    *(round(south * step), round(east * step)),
                    *(round(2 * south * step), round(2 * east * step)),
                    PRESS * self.quanta.quantum / size if size >= 0.4 * self.hop else 0.0,
                )
            )
        shadows = []
        for step in self._along(direction, self.longest_shadow, 1):
            down, right = round(south * step), round(east * step)
            length = math.hypot(down, right) * self.spacing
            fall = self.shadow_slope * length / self.quanta.quantum
            shadows.append((down, right, round(min(fall, 2.0**29))))
        return Blow(
            rise=(RISE * slope * south, RISE * slope * east),
            climb=(2 * slope * south, 2 * slope * east),
            aside=(shift * east, -shift * south),
            across=(1, 0) if rows_lie_across else (0, 1),
            levels=tuple(levels),
            shadows=tuple(shadows),
        )

    def gust(self, number: int) -> Gust:
        """Return one gust: of any length and a little askew, rounded up or down, by dice."""
        words = mix(np.arange(4, dtype=np.uint32) + np.uint32((4 * number) & 0xFFFFFFFF))
        dice = (mix(words ^ np.uint32(self.seed[0])) + np.uint32(self.seed[1])) * 2.0**-32
        south, east = towards(self.wind_of(number))
        length = self.hop * 2 * dice[0] / self.spacing
        askew = SPREAD * (2 * dice[1] - 1)
        cos, sin = math.cos(askew), math.sin(askew)
        rows, cols = self.shape
        down = math.floor(length * (south * cos + east * sin) + dice[2])
        right = math.floor(length * (east * cos - south * sin) + dice[3])
        down = min(max(down, 3 - rows), rows - 3)  # veering by two cells stays within one turn
        right = min(max(right, 3 - cols), cols - 3)
        return Gust(down, right)

    def entering(self, gust: Gust) -> int:
        """Return how many cells get their sand from beyond an open border."""
        rows, cols = self.shape
        return rows * cols - (rows - abs(gust.down)) * (cols - abs(gust.right))

    def refreshes(self) -> Iterator[tuple[int, int]]:
        """Yield the first gust, and the one after the last, between two computations of stress."""
        start = 0
        while start < self.gusts:
            wind = self.wind_of(start)
            end = start + 1
            while end < self.gusts and end - start < REFRESH and self.wind_of(end) == wind:
                end += 1
            yield start, end
            start = end


def towards(direction: float) -> tuple[float, float]:
    """Return the unit vector to the south and to the east in which a wind from there blows."""
    angle = math.radians(direction)
    return math.cos(angle), -math.sin(angle)


def moving_sand(speed: float, stress: float = 1.0) -> float:
    """Return the sand that a wind moves over a line, m3 of bulk a metre and year (m2/yr).

    ``6.7 rho_air / (g rho_sand) u*^2 (u* - u*_t)``, after Lettau & Lettau (1978).
    """
    friction = FRICTION * speed * math.sqrt(stress)
    excess = friction - FRICTION * THRESHOLD_SPEED
    return LETTAU * YEAR * friction * friction * max(0.0, excess)


def patches(grid: Grid, size: float, seed: tuple[int, int]) -> NDArray[np.float32]:
    """Return how unevenly sand lies at first, fixed in the world: -1 to 1, patches of a size."""
    rows, cols = grid.shape
    west, north = grid.north_west
    east = west + np.arange(cols) * grid.spacing
    up = north - np.arange(rows) * grid.spacing
    total = np.zeros(grid.shape, dtype=np.float32)
    for octave, (share, cos, sin) in enumerate(
        ((0.5, 0.8, 0.6), (0.3, -0.28, 0.96), (0.2, -0.6, -0.8))  # turned off the grid
    ):
        length = size / 2.3**octave
        x = (cos * east[None, :] - sin * up[:, None]) / length + 0.37 * (octave + 1)
        y = (sin * east[None, :] + cos * up[:, None]) / length + 0.71 * (octave + 1)
        i, j = np.floor(x), np.floor(y)
        with np.errstate(under="ignore"):
            noise = BASES["gradient"].numpy(
                *(i.astype(np.int64) & 0xFFFFFFFF, j.astype(np.int64) & 0xFFFFFFFF),
                *((x - i).astype(np.float32), (y - j).astype(np.float32)),
                *(seed[0] ^ octave, seed[1]),
            )
        total += np.float32(share / 0.6) * noise
    return np.minimum(np.maximum(total, np.float32(-1)), np.float32(1))
