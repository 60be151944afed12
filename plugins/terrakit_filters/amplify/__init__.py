"""Finer samples of a real terrain, with the detail that its own roughness promises."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import field_validator

from terrakit.compute import DeviceArray, check_cancelled
from terrakit.errors import InputError, ParameterError
from terrakit.heightfield import Field, Grid, Heightfield
from terrakit.operators import Filter
from terrakit.parameters import Maskable, Seed, parameter
from terrakit.running import Run, seed_words
from terrakit.world import FINE, parts
from terrakit_filters.amplify import reference
from terrakit_filters.amplify.measuring import (
    Innovation,
    local_share,
    measure,
    residuals,
    telling,
)
from terrakit_filters.amplify.reference import MARGIN, Level
from terrakit_filters.sampling import way_of

__all__ = ["Amplify", "Innovation", "measure"]

SMALLEST = 9
"""Samples a side below which nothing can be measured."""
WINDOW = 9
"""Samples a side of the window in which local roughness is measured."""
ROUGHEST = 5.0
"""Largest local roughness, of the mean."""


class Amplify(Filter):
    """Double the samples of a terrain once or more, with detail as rough as the terrain tells.

    Every new sample is guessed from its neighbours and displaced by what such guesses miss::

        z = (43 sum_4 z - 7 sum_8 z + 3 sum_4 z) / 128 + s(x) sigma 2^(-H l) g,   l = 1, 2, ...

    from the sixteen nearest points, first at the centres of cells (diamond), then at the middles of
    edges (square), by the same stencil turned by 45 degrees. It keeps paraboloids; the one number
    that this leaves open is the one that guesses real land best.

    Nothing is assumed of the detail: sigma is the root mean square of what the terrain's own
    samples tell beyond the same guess from every second sample, H is how fast that shrank at the
    last doubling, s(x) is how much of it there is in the 9 x 9 samples around. So rugged land gets
    rugged detail, plains stay plain, and the samples themselves are never changed.

    Water, lakes and what was filled in get no detail; there heights are linear between samples.

    Notes
    -----
    What is measured depends on the whole map. Tiles of one terrain agree where they overlap if
    they are cut from the amplified map.

    Detail is as rough as land, but no river has run over it: a few steps of erosion afterwards
    join it into valleys.

    References
    ----------
    A. Fournier, D. Fussell and L. Carpenter, "Computer rendering of stochastic models", CACM 1982.
    G. S. P. Miller, "The definition and rendering of terrain maps", SIGGRAPH 1986. J. Kovacevic
    and W. Sweldens, "Wavelet families of increasing order in arbitrary dimensions", IEEE
    Transactions on Image Processing 9, 2000, for stencils that keep polynomials.
    """

    name = "amplify"
    cites = ("Fournier, Fussell & Carpenter 1982", "Miller 1986", "Kovacevic & Sweldens 2000")
    uses = ("valid", "water_depth")
    fields = 5
    locality = "global"
    changes_grid = True
    turning: ClassVar = None
    idle: ClassVar = {"factor": 1}

    factor: int = parameter(
        4, "How many times finer the samples become: 2, 4, 8 or another power of two.", ge=1, le=64
    )
    spacing: float | None = parameter(
        None,
        "In place of the factor: double the samples until they are at most this far apart.",
        unit="m",
        ge=1e-6,
        le=1e9,
    )
    detail: float = parameter(
        1.0, "Height of the new detail: 1 as measured, 0 only smooth ground.", ge=0, le=10
    )
    where: Maskable = parameter(
        1.0, "Where there is new detail, 0 none to 1 all, for instance a mask.", ge=0, le=1
    )
    hurst_exponent: float | None = parameter(
        None,
        "How fast detail shrinks towards finer scales, 0 jagged to 1 smooth; without it as "
        "measured, which may be above 1 where the data are smoother than land.",
        ge=0,
        le=2,
    )
    modulation: bool = parameter(
        True, "Follow the local roughness; off spreads the same detail everywhere."
    )
    flat_slope: float = parameter(
        0.05,
        "Ground less steep than this over three samples is a lake and stays level.",
        unit="deg",
        ge=0,
        lt=90,
        advanced=True,
    )
    stencil: Literal["smooth", "mean"] = parameter(
        "smooth",
        "How new samples are guessed: smooth from sixteen neighbours, mean from four as published.",
        advanced=True,
    )
    seed: Seed = parameter(0, "Another number or word gives other detail.")

    presets: ClassVar = {
        "smooth": {"detail": 0.0},
        "rugged": {"detail": 1.5, "hurst_exponent": 0.8},
    }

    @field_validator("factor")
    @classmethod
    def _power_of_two(cls, factor: int) -> int:
        if factor & (factor - 1):
            raise ValueError("must be a power of two: 1, 2, 4, 8, 16, 32 or 64")
        return factor

    def grid_after(self, grid: Grid) -> Grid:
        """Return the grid of the finer samples; it begins where the terrain's does."""
        factor = 2 ** self._doublings(grid.spacing)
        rows, cols = ((n - 1) * factor + 1 for n in grid.shape)
        return Grid((rows, cols), grid.spacing / factor, grid.north_west, grid.crs)

    def _doublings(self, spacing: float) -> int:
        if self.spacing is None:
            return self.factor.bit_length() - 1
        doublings = 0
        while spacing / 2**doublings > self.spacing * (1 + 1e-9):
            doublings += 1
        if doublings > 6:
            raise ParameterError(
                f"spacing = {self.spacing:g}: is {spacing / self.spacing:g} times finer than the "
                f"terrain's {spacing:g} m; must be at most 64 times"
            )
        return doublings

    def apply(self, surface: Heightfield, run: Run) -> Heightfield:
        """Return the terrain and its layers on finer samples."""
        doublings = self._doublings(surface.spacing)
        if doublings == 0:
            return surface
        if min(surface.shape) < SMALLEST:
            raise InputError(
                f"the terrain has {surface.shape[0]}x{surface.shape[1]} samples, needs at least "
                f"{SMALLEST}x{SMALLEST} to measure its roughness; use resample"
            )
        return refined(self, surface, self.measured(surface), run)

    def measured(self, surface: Heightfield) -> Innovation:
        """Return what this operator measures of a terrain."""
        return measure(surface, is_mean=self.stencil == "mean")


def refined(
    operator: Amplify, surface: Heightfield, innovation: Innovation, run: Run
) -> Heightfield:
    """Return the terrain with finer samples whose detail is as ``innovation`` says.

    With the same innovation, overlapping terrains of the same world get the same detail where
    neither edge is near.
    """
    grid = operator.grid_after(surface.grid)
    doublings = operator._doublings(surface.spacing)
    strength, still = _strength(operator, surface), _still(operator, surface)
    words = run.words(operator.name, operator.seed)
    row, col = (
        math.floor(parts(along, surface.spacing) / FINE + 0.5)
        for along in (-surface.origin[1], surface.origin[0])
    )
    levels = []
    for level in range(doublings):
        centre, edge = innovation.deviations(level, operator.hurst_exponent)
        finer = 2 ** (level + 1)
        levels.append(
            Level(
                *(strength, still, seed_words(*words, level), centre, edge),
                *((row * finer, col * finer), level, operator.stencil == "mean"),
            )
        )
    after = MARGIN - 1
    around = ((MARGIN, after), (MARGIN, after))
    height = np.pad(surface.elevation, around, mode="reflect", reflect_type="odd")
    elevation: NDArray[np.float32] | DeviceArray
    if run.device is None:
        for doubling in levels:
            check_cancelled()
            height = reference.doubled(height, doubling)
        elevation = np.ascontiguousarray(height[MARGIN:-after, MARGIN:-after])
    else:
        elevation = _opencl(height, levels, grid.shape, run)
    layers = {
        name: _taken(surface.layer(name), way_of(name), doublings)
        for name in surface
        if name != "elevation"
    }
    return Heightfield.on_grid(grid, elevation, layers)


def _opencl(
    height: NDArray[np.float32], levels: list[Level], shape: tuple[int, int], run: Run
) -> DeviceArray:
    device = run.device
    assert device is not None
    program = device.program(
        __file__, "amplify.cl", {"AMPLIFY_MEAN": 1} if levels[0].is_mean else None
    )
    strength = device.upload(levels[0].strength)
    still = device.upload(levels[0].still)
    stride = strength.shape[1]
    here = device.upload(height)
    for level in levels:
        rows, cols = here.shape
        centre = device.empty((rows - 3, cols - 3))
        fine = device.empty((2 * (rows - 6), 2 * (cols - 6)))
        seed = [np.uint32(word) for word in level.seed]
        place = [
            *(np.int32((at + 2**31) % 2**32 - 2**31) for at in level.north_west),
            np.int32(level.level),
        ]
        passes: tuple[tuple[str, list[DeviceArray], float, tuple[int, ...]], ...] = (
            ("amplify_centre", [centre, here], level.centre, centre.shape),
            ("amplify_square", [fine, here, centre], level.edge, (rows - 6, cols - 6)),
        )
        for kernel, heights, deviation, target in passes:
            program.launch(
                kernel,
                target[:1] if device.is_cpu else target,
                *heights,
                strength,
                still,
                *seed,
                np.float32(deviation),
                *place,
                *(np.int32(n) for n in (*target, cols, stride)),
                local=(4,) if device.is_cpu else None,
            )
        device.finish()
        here = fine
    result = device.empty(shape)
    program.launch(
        "amplify_cut", shape, result, here, *(np.int32(n) for n in (*shape, here.shape[1]))
    )
    device.finish()
    return result


def _strength(operator: Amplify, surface: Heightfield) -> NDArray[np.float32]:
    """Return the share of the measured deviation at every sample, with the margin."""
    share: NDArray[np.float32] = np.ones(surface.shape, dtype=np.float32)
    if operator.modulation:
        missed = residuals(surface.elevation.astype(np.float64), 1, operator.stencil == "mean")
        share = local_share(missed, telling(surface), WINDOW, ROUGHEST)
    where = np.asarray(operator.value("where", surface), dtype=np.float32)
    share = share * where * np.float32(operator.detail)
    return np.pad(share, ((MARGIN, MARGIN - 1),) * 2, mode="edge")


def _still(operator: Amplify, surface: Heightfield) -> NDArray[np.uint8]:
    """Return 1 for cells of water, of what was filled in and of lakes, with the margin.

    A lake is level over three by three samples at least: two equal heights side by side are no
    lake, above all in a terrain of whole metres.
    """
    height = surface.elevation
    rise = surface.spacing * math.tan(math.radians(operator.flat_slope))
    corners = [
        height[s : height.shape[0] - 1 + s, e : height.shape[1] - 1 + e]
        for s in (0, 1)
        for e in (0, 1)
    ]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    level = high.astype(np.float64) - low <= rise
    blocks = level[:-1, :-1] & level[:-1, 1:] & level[1:, :-1] & level[1:, 1:]
    still = ~_all_corners(telling(surface))
    for s in (0, 1):
        for e in (0, 1):
            still[s : s + blocks.shape[0], e : e + blocks.shape[1]] |= blocks
    return np.pad(still.astype(np.uint8), ((MARGIN, MARGIN),) * 2, mode="edge")


def _all_corners(at: NDArray[np.bool_]) -> NDArray[np.bool_]:
    result: NDArray[np.bool_] = at[:-1, :-1] & at[:-1, 1:] & at[1:, :-1] & at[1:, 1:]
    return result


def _taken(field: Field, way: str, doublings: int) -> Field:
    """Return a layer on the finer samples, linearly, or from the nearest where it numbers."""
    if way == "nearest":
        factor = 2**doublings
        row, col = ((np.arange((n - 1) * factor + 1) + factor // 2) // factor for n in field.shape)
        nearest: Field = field[row[:, None], col[None, :]]
        return nearest
    half = np.float32(0.5)
    for _ in range(doublings):
        for axis in (0, 1):
            values = np.moveaxis(field, axis, 0)
            finer = np.empty((2 * len(values) - 1, *values.shape[1:]), dtype=np.float32)
            finer[::2] = values
            finer[1::2] = half * values[1:] + half * values[:-1]
            field = np.moveaxis(finer, 0, axis)
    return np.ascontiguousarray(field)
