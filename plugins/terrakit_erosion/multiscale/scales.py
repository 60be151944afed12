"""Terrain on coarser samples, and changes taken back to finer ones.

A coarser grid has twice the spacing and about half the samples a side, centred on the same ground:
of an odd number of samples every second is kept, of an even number two become one between them.
So any number can be halved, and turning the terrain turns the result. Heights go down as means
that keep the volume (full weighting), changes go up as B-splines, the adjoint family: quadratic
for even, cubic for odd numbers. A spline is smooth over the cells of the coarse grid, never leaves
the range of its values, and hands every coarse sample's change on in full, so that what was moved
is kept. All is elementwise float64 and integers, in one order: the same bytes everywhere.

References
----------
W. Briggs, V. Henson and S. McCormick, "A multigrid tutorial", 2000. G. Chaikin, "An algorithm for
high speed curve generation", 1974. E. Catmull and J. Clark, Computer-Aided Design 10, 1978.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrakit.heightfield import Field, Grid, Heightfield
from terrakit.quanta import Quanta

F = np.float32
Numbers = NDArray[np.float64]
Counts = NDArray[np.int64]
FINER = 64
"""Parts of a quantum in which a change is carried, so that rounding comes last."""
MOST_CORRECTION = 0.5
"""Largest share of a change by which it is mended so that its mean is kept."""
NUMBERED = ("valid", "plate", "plate_type", "boundary_class")
"""Layers whose values are names or yes and no: a mean of two of them means nothing."""


def coarser(grid: Grid) -> Grid:
    """Return the grid of twice the spacing over the same ground."""
    rows, cols = grid.shape
    x, y = grid.north_west
    aside = [0.0 if count % 2 else 0.5 * grid.spacing for count in (rows, cols)]
    shape = (rows + 1) // 2, (cols + 1) // 2
    return Grid(shape, 2.0 * grid.spacing, (x + aside[1], y - aside[0]), grid.crs)


def restricted(surface: Heightfield) -> Heightfield:
    """Return a terrain and all its layers on the coarser grid.

    Heights are whole quanta of it, in which erosions count, so that what they change is exact.
    """
    grid = coarser(surface.grid)
    layers = {
        name: (_picked if is_numbered(name) else _means)(surface.layer(name)) for name in surface
    }
    means = layers.pop("elevation")
    quantum = Quanta.fitting(means, grid.spacing).quantum
    elevation = (np.rint(means.astype(np.float64) / quantum) * quantum).astype(F)
    return Heightfield.on_grid(grid, elevation, layers).with_strata(surface.strata)


def is_numbered(layer: str) -> bool:
    """Return whether a layer's values are names that cannot be averaged."""
    return layer in NUMBERED or layer.endswith(("_id", "_index"))


def _means(field: Field) -> Field:
    """Return means under the tents of the coarser grid."""
    sums, down = _sums(field.astype(np.float64))
    sums, across = _sums(np.ascontiguousarray(sums.T))
    with np.errstate(under="ignore"):
        means: Field = (sums.T / (down[:, None] * across[None, :])).astype(F)
    return means


def _sums(rows: Numbers) -> tuple[Numbers, Numbers]:
    """Return sums of neighbouring rows about the coarser ones, and of their weights."""
    count = len(rows)
    if count % 2 == 0:
        return rows[0::2] + rows[1::2], np.full(count // 2, 2.0)
    sums, weights = 2.0 * rows[0::2], np.full((count + 1) // 2, 4.0)
    beside = np.zeros_like(sums)
    beside[1:] = rows[1::2]
    beside[:-1] += rows[1::2]
    weights[[0, -1]] = 3.0
    return sums + beside, weights


def _picked(field: Field) -> Field:
    """Return values that are there: the sample's own, the largest where several become one."""
    for _ in ("rows", "columns"):
        field = (field[0::2] if len(field) % 2 else np.maximum(field[0::2], field[1::2])).T
    return np.ascontiguousarray(field)


def prolonged(change: Any, shape: tuple[int, int]) -> Any:
    """Return a change of the coarser samples as that of the finer ones, times 64.

    Whole numbers stay whole: every weight is a number of eighths.
    """
    down = _spline(change, shape[0])
    return np.ascontiguousarray(_spline(np.ascontiguousarray(down.T), shape[1]).T)


def _spline(rows: Any, count: int) -> Any:
    """Return ``count`` rows of the B-spline through fewer, times 8; beyond its ends it is level."""
    before = np.concatenate((rows[:1], rows[:-1]))
    after = np.concatenate((rows[1:], rows[-1:]))
    result = np.empty((count, rows.shape[1]), dtype=rows.dtype)
    if count % 2 == 0:
        result[0::2] = 2 * before + 6 * rows
        result[1::2] = 6 * rows + 2 * after
    else:
        result[0::2] = before + 6 * rows + after
        result[1::2] = (4 * rows + 4 * after)[:-1]
    return result


def raised(fine: Heightfield, change: Numbers) -> Field:
    """Return the heights of the finer terrain with the change (m) of the coarser one added.

    The mean change is kept. At the edge of an odd number of samples a coarse cell reaches half a
    fine cell beyond the ground, and what lies there would be lost; so rises are made larger and
    falls smaller, or the other way about, by the share that mends the mean: some 0.1 % on usual
    terrain. Ground that does not change keeps its bits.
    """
    before = fine.elevation
    largest = float(np.abs(change).max())
    quanta = Quanta.fitting(before, fine.spacing, 2.0 * largest)
    part = quanta.quantum / FINER
    parts = np.rint(change / part).astype(np.int64)
    grown: Counts = prolonged(parts, fine.shape)
    rise = grown.astype(np.float64) / 64
    wanted = _total(parts) / parts.size * rise.size
    missing = wanted - _total(grown) / 64
    size = _total(np.abs(grown)) / 64
    share = min(max(missing / size, -MOST_CORRECTION), MOST_CORRECTION) if size else 0.0
    rise = rise + share * np.abs(rise)
    start = quanta.count(before)
    end = (start + np.rint(rise / FINER).astype(np.int64)).astype(np.int32)
    return quanta.height(before, start, end)


def _total(counts: Counts) -> int:
    """Return the sum of whole numbers, however large."""
    return sum(int(row) for row in counts.sum(axis=1, dtype=np.int64))


def added(
    name: str, fine: Field | None, before: Field | None, after: Field, shape: tuple[int, int]
) -> Field:
    """Return a layer of the finer terrain with the change of the coarser one added.

    Parameters
    ----------
    name
        The layer.
    fine
        Its values on the finer grid so far; None where it is not yet there, which counts as 0.
    before, after
        Its values on the coarser grid.
    shape
        Rows and columns of the finer grid.
    """
    if is_numbered(name):
        if fine is not None:
            return fine
        doubled = after.repeat(2, axis=0).repeat(2, axis=1)
        return np.ascontiguousarray(doubled[: shape[0], : shape[1]])
    base = np.zeros(shape, F) if fine is None else fine
    change = after.astype(np.float64) - (0.0 if before is None else before)
    grown = prolonged(change, shape) / 64
    low, high = min(base.min(), after.min()), max(base.max(), after.max())
    moved = np.clip((base + grown).astype(F), low, high)
    return np.where(grown == 0, base, moved)
