"""Terrain by repeated halving of a lattice that is anchored in the world.

The three operators diamond_square, midpoint_displacement and square_square differ in how they
guess a new point from old ones; everything else is here.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import DeviceArray, check_cancelled, exact
from terrakit.errors import ParameterError
from terrakit.heightfield import Grid, Heightfield
from terrakit.operators import Generator
from terrakit.parameters import Seed, parameter
from terrakit.running import Run, seed_words
from terrakit.world import FINE, parts
from terrakit_generators.lattice_subdivision import reference
from terrakit_generators.lattice_subdivision.reference import Noise

LARGEST_BAND = 2**22
"""About how many lattice points are held at a time; a map is made in bands of rows."""


class LatticeSubdivision(Generator):
    """Halve a lattice again and again; displace what is new by less and less.

    The coarsest lattice lies in the world at whole multiples of the wavelength and carries random
    heights of deviation ``amplitude``. Level l has spacing ``wavelength / 2^l``; what it adds to
    the guess from level l - 1 has the deviation that a self-similar surface of exponent H keeps::

        s_1(l) = amplitude sqrt(2 (2^-H - 1/4 - 2^(H-3))) 2^(-H (l - 1)),   s_2(l) = s_1(l) 2^(-H/2)

    Levels end at the spacing of the map where that is a level, and otherwise at or below half of
    it, between whose points the surface is smooth. Random numbers are hashes of the level and the
    world index of a point, and positions are exact fractions: a tile equals the same part of a
    larger map bit for bit, and a finer map only adds levels.
    """

    fields: ClassVar[int] = 3
    portrait: ClassVar[float | None] = 12000.0
    rule: ClassVar[str] = ""
    """The kernel's name after the stem."""
    is_shifted: ClassVar[bool] = False
    """Whether each level lies a quarter of a step south-east of the one before."""

    amplitude: float = parameter(
        500.0,
        "Standard deviation of the heights of the largest forms; peaks reach three times as far.",
        unit="m",
        ge=0,
        le=1e6,
    )
    wavelength: float = parameter(
        5000.0,
        "Spacing of the coarsest lattice: the largest hills are about this far apart.",
        unit="m",
        gt=0,
        le=1e8,
    )
    hurst_exponent: float = parameter(
        0.85, "Smoothness: near 0 is jagged, near 1 is gently rolling.", ge=0, le=1
    )
    offset: float = parameter(0.0, "Height of the middle of the range.", unit="m", ge=-1e6, le=1e6)
    noise: Literal["gaussian", "uniform"] = parameter(
        "gaussian",
        "How random heights are spread: gaussian has rare large ones, uniform none.",
        advanced=True,
    )
    seed: Seed = parameter(0, "Another number or word gives other hills.")

    @property
    @abstractmethod
    def second_share(self) -> float:
        """Deviation of the second half-step over that of the first."""
        raise NotImplementedError

    @property
    def adds_again(self) -> bool:
        """Whether points that are already there are displaced at every level."""
        return False

    def generate(self, grid: Grid, run: Run) -> Heightfield:
        """Return subdivided terrain on ``grid``."""
        lattice = _Lattice(grid, self.wavelength, self.is_shifted)
        noises = self._noises(run, lattice.levels)
        ground = seed_words(*run.words(self.name, self.seed), 0)
        bands = lattice.bands()
        device = run.device
        if device is None:
            elevation = np.empty(grid.shape, dtype=np.float32)
            for first, last in bands:
                elevation[first:last] = self._reference(lattice, noises, ground, first, last)
            return Heightfield.on_grid(grid, elevation)
        result = device.empty(grid.shape)
        for first, last in bands:
            self._opencl(lattice, noises, ground, first, last, result)
        device.finish()
        return Heightfield.on_grid(grid, result)

    def _noises(self, run: Run, levels: int) -> list[Noise]:
        """Return the random heights of every level but the coarsest."""
        step = float(exact.power(np.array([2.0], dtype=np.float32), -self.hurst_exponent)[0])
        # What four corners leave open of the height of their centre, where level 0 is white noise
        # of deviation 1 and its variogram at one step therefore 2.
        first = self.amplitude * math.sqrt(2 * max(0.0, step - 0.25 - 0.125 / step))
        words = run.words(self.name, self.seed)
        noises = []
        for level in range(1, levels + 1):
            seeds = (*seed_words(*words, level, 1), *seed_words(*words, level, 2))
            noises.append(
                Noise(
                    seeds,
                    first,
                    first * self.second_share,
                    self.noise == "uniform",
                    self.adds_again,
                )
            )
            first *= step
        return noises

    def _reference(
        self,
        lattice: _Lattice,
        noises: list[Noise],
        ground: tuple[int, int],
        first: int,
        last: int,
    ) -> NDArray[np.float32]:
        windows = lattice.windows(first, last)
        height = reference.scatter(
            ground,
            self.amplitude,
            self.noise == "uniform",
            windows[0].north_west,
            windows[0].shape,
        )
        for noise, coarse, fine in zip(noises, windows, windows[1:], strict=False):
            check_cancelled()
            height = reference.refine(
                self.rule, height, noise, fine.north_west, fine.inset(coarse), fine.cells
            )
        samples = lattice.samples(windows[-1], first, last)
        return reference.sample(height, *samples, self.offset)

    def _opencl(
        self,
        lattice: _Lattice,
        noises: list[Noise],
        ground: tuple[int, int],
        first: int,
        last: int,
        result: DeviceArray,
    ) -> None:
        device = result.device
        defines = {}
        if self.noise == "uniform":
            defines["LATTICE_UNIFORM"] = 1
        if self.adds_again:
            defines["LATTICE_ADDITIONS"] = 1
        program = device.program(__file__, "lattice_subdivision.cl", defines or None)
        windows = lattice.windows(first, last)
        height = device.empty(windows[0].shape)
        program.launch(
            "lattice_subdivision_scatter",
            windows[0].shape,
            height,
            *(np.uint32(word) for word in ground),
            np.float32(self.amplitude),
            *_whole(*windows[0].north_west, *windows[0].shape),
        )
        for noise, coarse, fine in zip(noises, windows, windows[1:], strict=False):
            finer = device.empty(fine.shape)
            program.launch(
                f"lattice_subdivision_{self.rule}",
                fine.cells[:1] if device.is_cpu else fine.cells,
                finer,
                height,
                *(np.uint32(word) for word in noise.seeds),
                np.float32(noise.first),
                np.float32(noise.second),
                *_whole(*fine.north_west, *fine.inset(coarse), *fine.cells, coarse.shape[1]),
                local=(4,) if device.is_cpu else None,
            )
            height = finer
        col_at, across, row_at, down = lattice.samples(windows[-1], first, last)
        shape = last - first, result.shape[1]
        program.launch(
            "lattice_subdivision_sample",
            shape[:1] if device.is_cpu else shape,
            result,
            height,
            *(device.upload(values) for values in (col_at, across, row_at, down)),
            np.float32(self.offset),
            *_whole(first, *shape, windows[-1].shape[1]),
            local=(4,) if device.is_cpu else None,
        )


class HalfSteps(LatticeSubdivision):
    """Subdivision that makes centres and edges in two turns.

    Each half-step shrinks the distance to the neighbours by sqrt 2, so the deviation of what is
    added shrinks by 2^(-H/2).
    """

    additions: bool = parameter(
        False,
        "Displace all points at every level, not only new ones: rougher, and no height is kept.",
    )
    half_step: bool = parameter(
        True,
        "Shrink random heights with each half-step; off is the published single height a level.",
        advanced=True,
    )

    @property
    def second_share(self) -> float:
        """2^(-H/2), or 1 as published."""
        if not self.half_step:
            return 1.0
        return float(exact.power(np.array([2.0], dtype=np.float32), -0.5 * self.hurst_exponent)[0])

    @property
    def adds_again(self) -> bool:
        """Whether points that are already there are displaced at every level."""
        return self.additions


@dataclass(frozen=True)
class _Window:
    """A part of one level: world indices of its first and last row and column."""

    north: int
    south: int
    west: int
    east: int

    @property
    def north_west(self) -> tuple[int, int]:
        return self.north, self.west

    @property
    def shape(self) -> tuple[int, int]:
        return self.south - self.north + 1, self.east - self.west + 1

    @property
    def cells(self) -> tuple[int, int]:
        """How many points of the coarser level it is made from."""
        rows, cols = self.shape
        return rows // 2, cols // 2

    def even(self) -> _Window:
        """Return the window widened to whole groups of four points."""
        return _Window(self.north & ~1, self.south | 1, self.west & ~1, self.east | 1)

    def coarser(self) -> _Window:
        """Return what of the coarser level its points need: one more on every side."""
        return _Window(
            self.north // 2 - 1, self.south // 2 + 1, self.west // 2 - 1, self.east // 2 + 1
        )

    def inset(self, coarse: _Window) -> tuple[int, int]:
        """Return where in ``coarse`` the first point lies that it is made from."""
        return self.north // 2 - coarse.north, self.west // 2 - coarse.west


class _Lattice:
    """How the samples of a grid lie in the finest level; x runs east and y south."""

    def __init__(self, grid: Grid, wavelength: float, is_shifted: bool) -> None:
        if wavelength < grid.spacing:
            raise ParameterError(
                f"wavelength = {wavelength:g}: must be at least the spacing of the map, "
                f"{grid.spacing:g} m; use a longer one or more samples"
            )
        self.grid = grid
        self.is_shifted = is_shifted
        spacing, longest = Fraction(grid.spacing), Fraction(wavelength)
        self.levels = max(0, math.ceil(longest / spacing) - 1).bit_length()
        if longest / 2**self.levels != spacing:
            # Samples wander through the cells of the lattice. Where they fall into the middle of
            # one the surface is smoother than at its points, which shows as a beat unless cells
            # are small.
            self.levels += 1
        self.steps = spacing * 2**self.levels / longest
        """Steps of the finest lattice from one sample to the next."""

    @cached_property
    def _positions(self) -> tuple[list[int], list[int]]:
        """Return where rows and columns lie in the finest level, in units of 2^-32 steps."""
        rows, cols = self.grid.shape
        x, y = self.grid.north_west
        shift = Fraction(2**self.levels - 1, 2) if self.is_shifted else Fraction(0)
        along = []
        for origin, count in ((-y, rows), (x, cols)):
            start = parts(origin, self.grid.spacing)
            scale = self.steps * 2**32 / FINE
            numerator, denominator = scale.numerator, scale.denominator
            moved = math.floor(shift * 2**32)
            along.append(
                [(start + k * FINE) * numerator // denominator - moved for k in range(count)]
            )
        return along[0], along[1]

    def bands(self) -> list[tuple[int, int]]:
        """Return first and last row (beyond the end) of the parts in which a map is made."""
        rows, cols = self.grid.shape
        a_row = (float(self.steps) * cols + 8) * max(1.0, float(self.steps))
        step = max(1, int(LARGEST_BAND / a_row))
        return [(first, min(first + step, rows)) for first in range(0, rows, step)]

    def windows(self, first: int, last: int) -> list[_Window]:
        """Return the part of each level, coarsest first, that rows of the map need."""
        down, across = self._positions
        window = _Window(
            (down[first] >> 32) - 1,
            (down[last - 1] >> 32) + 2,
            (across[0] >> 32) - 1,
            (across[-1] >> 32) + 2,
        )
        if self.is_shifted:  # a spline's middle point may be the next one
            window = _Window(window.north, window.south + 1, window.west, window.east + 1)
        windows = []
        for _ in range(self.levels):
            window = window.even()
            windows.append(window)
            window = window.coarser()
        return [window, *reversed(windows)]

    def samples(
        self, window: _Window, first: int, last: int
    ) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]:
        """Return columns and their weights, rows and their weights, in the finest window."""
        down, across = self._positions
        weigh = _spline if self.is_shifted else _interpolating
        result = []
        for positions, start in ((across, window.west), (down[first:last], window.north)):
            inside = np.array([p - (start << 32) for p in positions], dtype=np.int64)
            result += weigh(inside)
        return result[0], result[1], result[2], result[3]  # type: ignore[return-value]


def _interpolating(position: NDArray[np.int64]) -> list[NDArray[np.generic]]:
    """Return first point and weights of Catmull and Rom's cubic: smooth, exact at points."""
    t = ((position & 0xFFFFFFFF) >> 8).astype(np.float32) * np.float32(2.0**-24)
    half, one = np.float32(0.5), np.float32(1)
    weights = np.stack(
        [
            half * t * ((np.float32(2) - t) * t - one),
            half * ((np.float32(3) * t - np.float32(5)) * t * t + np.float32(2)),
            half * t * ((np.float32(4) - np.float32(3) * t) * t + one),
            half * t * t * (t - one),
        ]
    )
    return [((position >> 32) - 1).astype(np.int32), np.ascontiguousarray(weights)]


def _spline(position: NDArray[np.int64]) -> list[NDArray[np.generic]]:
    """Return first point and weights of the quadratic B-spline: the limit of square-square."""
    nearest = (position + 2**31) >> 32
    t = ((position - (nearest << 32)) >> 8).astype(np.float32) * np.float32(2.0**-24)
    half = np.float32(0.5)
    weights = np.stack(
        [
            half * (half - t) * (half - t),
            np.float32(0.75) - t * t,
            half * (half + t) * (half + t),
            np.zeros_like(t),
        ]
    )
    return [(nearest - 1).astype(np.int32), np.ascontiguousarray(weights)]


def _whole(*values: int) -> list[np.int32]:
    """Return integers as the signed 32-bit numbers with the same low bits."""
    return [np.int32((value + 2**31) % 2**32 - 2**31) for value in values]
