"""Thermal erosion in NumPy: the readable definition, and the oracle of ``thermal.cl``.

Beyond a closed border lies a mirror: every cell has eight neighbours, and one outside the map is as
high as the cell of the border beside it. So a slope that is the same all along a border falls there
as fast as inside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from terrakit.mesh import EdgeGraph

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
DIRECTIONS = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
UNSURE = 16
"""Quanta that truncation may hide of what flows out of a cell."""
CAUTIOUS = F(1 - 2.0**-20)
"""Keeps what a cell gives away below what it has, however the factors round."""


def relax(
    height: Counts,
    bed: Counts,
    talus: Counts,
    axial: float,
    diagonal: float,
    exported: NDArray[np.int64] | None,
) -> Counts:
    """Return heights after one sweep of the flux form.

    Parameters
    ----------
    height
        Heights of shape (rows, cols), quanta.
    bed
        Height of the bedrock under loose material; lowered in place where the ground falls below.
    talus
        Largest difference to an axial neighbour that stays put, quanta; () or (rows, cols).
    axial, diagonal
        Share of the excess that an axial and a diagonal neighbour gets.
    exported
        Where the borders are open, what left so far: north, south, west and east, along the
        border; changed in place.
    """
    talus = np.broadcast_to(talus, height.shape)
    sum_out = np.zeros_like(height)
    for slanted, (z, limit) in _neighbors(height, talus):
        share = F(diagonal if slanted else axial)
        d = height - z
        upper = np.where(d > 0, talus, limit)
        sum_out += (share * _excess(d, _slanted(upper, slanted)).astype(F)).astype(np.int32)

    def leaving(slope: Counts, cells: tuple[slice, slice]) -> Counts:
        return _beyond(slope, talus[cells], lambda e, slanted: (axial, diagonal)[slanted] * e)

    axial, diagonal = F(axial), F(diagonal)
    sum_out += _through_borders(height, leaving, exported)
    after = height - sum_out
    np.minimum(bed, after, out=bed)
    return after


def share_out(
    height: Counts,
    bed: Counts,
    talus: Counts,
    share: float,
    exported: NDArray[np.int64] | None,
) -> Counts:
    """Return heights after one sweep of the proportional form; arguments as in :func:`relax`."""
    talus = np.broadcast_to(talus, height.shape)
    weight = _proportion(height, talus, share, exported is not None)
    sum_out = np.zeros_like(height)
    for slanted, (z, limit, other) in _neighbors(height, talus, weight):
        d = height - z
        e = _excess(d, _slanted(np.where(d > 0, talus, limit), slanted))
        sum_out += (np.where(e > 0, weight, other) * e.astype(F)).astype(np.int32)

    def leaving(slope: Counts, cells: tuple[slice, slice]) -> Counts:
        return _beyond(slope, talus[cells], lambda e, slanted: weight[cells] * e)

    sum_out += _through_borders(height, leaving, exported)
    after = height - sum_out
    np.minimum(bed, after, out=bed)
    return after


def hold(
    height: Counts,
    bed: Counts,
    talus: Counts,
    axial: float,
    diagonal: float,
    open_border: bool,
) -> Floats:
    """Return which share of what would flow out of each cell its loose material can supply."""
    out = np.zeros_like(height)
    for slanted, (z,) in _neighbors(height):
        share = F(diagonal if slanted else axial)
        e = np.maximum(height - z - _slanted(talus, slanted), 0)
        out += (share * e.astype(F)).astype(np.int32)
    if open_border:
        shares = F(axial), F(diagonal)
        for _, cells, slope in _border_slopes(height):
            out[cells] += _beyond(slope, talus[cells], lambda e, slanted: shares[slanted] * e)
    return _supplied(height - bed, out)


def hold_shares(
    height: Counts,
    bed: Counts,
    talus: Counts,
    rock: Counts,
    softness: Floats,
    share: float,
    open_border: bool,
) -> tuple[Floats, Floats]:
    """Return the weights of loose material and of rock for the proportional form."""
    loose, largest = _proportion_of(height, talus, share, open_border)
    out = (F(share) * largest.astype(F)).astype(np.int32)
    loose = loose * _supplied(height - bed, out)
    return loose, softness * _proportion(height, rock, share, open_border)


def slide(
    height: Counts,
    bed: Counts,
    talus: Counts,
    rock: Counts,
    weight: Floats,
    rock_weight: Floats,
    axial: float,
    diagonal: float,
    exported: NDArray[np.int64] | None,
) -> Counts:
    """Return heights after one sweep in which loose material and bedrock each have an angle.

    What flows is the larger of what loose material would give, as far as it goes round, and of what
    the rock under it would. It is taken from the loose material first.

    Parameters
    ----------
    height, bed
        As in :func:`relax`.
    talus, rock
        Largest difference to an axial neighbour at which loose material and rock stay put, quanta.
    weight, rock_weight
        Factors of the upper cell on what loose material and what rock gives.
    axial, diagonal, exported
        As in :func:`relax`; both shares are 1 where the weights hold them already.
    """
    sum_out = np.zeros_like(height)
    here = talus, rock, weight, rock_weight
    for slanted, (z, *there) in _neighbors(height, *here):
        share = F(diagonal if slanted else axial)
        d = height - z
        upper = [np.where(d > 0, a, b) for a, b in zip(here, there, strict=True)]
        flux = _larger(np.abs(d), slanted, share, *upper)
        sum_out += np.where(d > 0, flux, -flux)

    def leaving(slope: Counts, cells: tuple[slice, slice]) -> Counts:
        along = [values[cells] for values in here]
        straight = _larger(slope, False, F(axial), *along)
        return straight + np.int32(2) * _larger(slope, True, F(diagonal), *along)

    sum_out += _through_borders(height, leaving, exported)
    after = height - sum_out
    np.minimum(bed, after, out=bed)
    return after


def limit_of(repose: Floats, scale: float) -> Counts:
    """Return slopes (tangents) as differences to an axial neighbour, quanta."""
    return np.minimum(repose * F(scale), F(2**29)).astype(np.int32)


def relax_mesh(
    height: Counts,
    bed: Counts,
    volume: NDArray[np.int64],
    base: Counts,
    slope: Floats,
    graph: EdgeGraph,
    length: Floats,
    conductance: Floats,
    height_a_volume: Floats,
) -> tuple[Counts, NDArray[np.int64]]:
    """Return heights and volumes after one sweep over the edges of a mesh.

    Parameters
    ----------
    height, base
        Heights now and at the start, quanta, of shape (n,).
    bed
        Height of the bedrock; lowered in place where the ground falls below.
    volume
        Volume gained since the start, quanta of volume.
    slope
        Tangent of the talus angle of each vertex.
    graph
        Neighbours in compressed rows.
    length
        Horizontal length of each half-edge, quanta.
    conductance
        Quanta of volume that pass along each half-edge for each quantum of excess.
    height_a_volume
        Quanta of height for each quantum of volume, by vertex.
    """
    owner = np.repeat(np.arange(len(height)), np.diff(graph.start))
    d = height[owner] - height[graph.neighbor]
    upper = np.where(d > 0, slope[owner], slope[graph.neighbor])
    limit = limit_of(upper * length, 1.0)
    flux = (conductance * _excess(d, limit).astype(F)).astype(np.int64)
    return _moved(flux, owner, bed, volume, base, height_a_volume)


def hold_mesh(
    height: Counts,
    bed: Counts,
    slope: Floats,
    graph: EdgeGraph,
    length: Floats,
    conductance: Floats,
    height_a_volume: Floats,
) -> Floats:
    """Return :func:`hold` for the vertices of a mesh; arguments as in :func:`relax_mesh`."""
    count = np.diff(graph.start)
    owner = np.repeat(np.arange(len(height)), count)
    d = height[owner] - height[graph.neighbor]
    e = np.maximum(d - limit_of(slope[owner] * length, 1.0), 0)
    out = np.zeros(len(height), dtype=np.int64)
    np.add.at(out, owner, (conductance * e.astype(F)).astype(np.int64))
    given = (out + count + 1).astype(F) * height_a_volume
    loose = (height - bed).astype(F)
    scarce = loose < given
    return np.where(scarce, loose / np.where(scarce, given, F(1)) * CAUTIOUS, F(1))


def slide_mesh(
    height: Counts,
    bed: Counts,
    volume: NDArray[np.int64],
    base: Counts,
    slope: Floats,
    rock: Floats,
    weight: Floats,
    rock_weight: Floats,
    graph: EdgeGraph,
    length: Floats,
    conductance: Floats,
    height_a_volume: Floats,
) -> tuple[Counts, NDArray[np.int64]]:
    """Return :func:`relax_mesh` with a slope and a weight each for loose material and rock."""
    owner = np.repeat(np.arange(len(height)), np.diff(graph.start))
    d = height[owner] - height[graph.neighbor]
    upper = np.where(d > 0, owner, graph.neighbor)
    steep = np.abs(d)
    given = [
        (
            conductance
            * factor[upper]
            * np.maximum(steep - limit_of(angle[upper] * length, 1.0), 0).astype(F)
        ).astype(np.int64)
        for angle, factor in ((slope, weight), (rock, rock_weight))
    ]
    flux = np.maximum(*given)
    return _moved(np.where(d > 0, flux, -flux), owner, bed, volume, base, height_a_volume)


def _moved(
    flux: NDArray[np.int64],
    owner: NDArray[np.intp],
    bed: Counts,
    volume: NDArray[np.int64],
    base: Counts,
    height_a_volume: Floats,
) -> tuple[Counts, NDArray[np.int64]]:
    volume = volume.copy()
    np.subtract.at(volume, owner, flux)
    height = base + (volume.astype(F) * height_a_volume).astype(np.int32)
    np.minimum(bed, height, out=bed)
    return height, volume


def _neighbors(
    *fields: NDArray[np.generic],
) -> Iterator[tuple[bool, list[NDArray[np.generic]]]]:
    """Yield, for each direction, whether it is slanted and every field as seen by a neighbour."""
    rows, cols = fields[0].shape
    padded = [np.pad(field, 1, mode="edge") for field in fields]
    for dr, dc in DIRECTIONS:
        there = slice(1 + dr, 1 + dr + rows), slice(1 + dc, 1 + dc + cols)
        yield dr != 0 and dc != 0, [field[there] for field in padded]


def _border_slopes(height: Counts) -> Iterator[tuple[int, tuple[slice, slice], Counts]]:
    """Yield, for each side, its number, its cells and how far they lie below those behind."""
    whole = slice(None)
    for side, (first, inner) in enumerate(
        (
            ((slice(0, 1), whole), (slice(1, 2), whole)),
            ((slice(-1, None), whole), (slice(-2, -1), whole)),
            ((whole, slice(0, 1)), (whole, slice(1, 2))),
            ((whole, slice(-1, None)), (whole, slice(-2, -1))),
        )
    ):
        yield side, first, height[inner] - height[first]


def _through_borders(
    height: Counts,
    leaving: Callable[[Counts, tuple[slice, slice]], Counts],
    exported: NDArray[np.int64] | None,
) -> Counts:
    """Return what leaves each cell through open borders, down the slope that goes on beyond."""
    out = np.zeros_like(height)
    if exported is None:
        return out
    for side, cells, slope in _border_slopes(height):
        through = leaving(slope, cells)
        out[cells] += through
        exported[side, : through.size] += through.ravel()
    return out


def _beyond(slope: Counts, talus: Counts, given: Callable[[Floats, bool], Floats]) -> Counts:
    """Return what goes to the three neighbours beyond a border."""
    straight, slanted = (
        given(np.maximum(slope - _slanted(talus, s), 0).astype(F), s).astype(np.int32)
        for s in (False, True)
    )
    return straight + np.int32(2) * slanted


def _larger(
    steep: Counts,
    slanted: bool,
    share: np.float32,
    talus: Counts,
    rock: Counts,
    weight: Floats,
    rock_weight: Floats,
) -> Counts:
    """Return the larger of what loose material and of what rock gives."""
    loose = np.maximum(steep - _slanted(talus, slanted), 0).astype(F)
    firm = np.maximum(steep - _slanted(rock, slanted), 0).astype(F)
    return np.maximum(
        (share * weight * loose).astype(np.int32), (share * rock_weight * firm).astype(np.int32)
    )


def _proportion(height: Counts, talus: Counts, share: float, open_border: bool) -> Floats:
    return _proportion_of(height, talus, share, open_border)[0]


def _proportion_of(
    height: Counts, talus: Counts, share: float, open_border: bool
) -> tuple[Floats, Counts]:
    """Return how much of each excess a cell gives away, and its largest excess."""
    largest = np.zeros_like(height)
    totals = [np.zeros(height.shape, dtype=np.uint32) for _ in range(2)]
    for slanted, (z,) in _neighbors(height):
        e = np.maximum(height - z - _slanted(talus, slanted), 0)
        largest = np.maximum(largest, e)
        totals[slanted] += e.astype(np.uint32)
    total = totals[0].astype(F) + totals[1].astype(F)
    if open_border:
        outside = [np.zeros(height.shape, dtype=np.uint32) for _ in range(2)]
        for _, cells, slope in _border_slopes(height):
            for slanted in (False, True):
                e = np.maximum(slope - _slanted(talus[cells], slanted), 0)
                largest[cells] = np.maximum(largest[cells], e)
                outside[slanted][cells] += e.astype(np.uint32)
        beyond = outside[0].astype(F) + F(2) * outside[1].astype(F)
        total = total + beyond
    gives = total > 0
    weight = np.where(gives, F(share) * largest.astype(F) / np.where(gives, total, F(1)), F(0))
    return weight.astype(F), largest


def _supplied(loose: Counts, out: Counts) -> Floats:
    """Return the share of ``out`` that is there, so that no more is given than there is."""
    wanted = (out + np.int32(UNSURE)).astype(F)
    there = loose.astype(F)
    scarce = there < wanted
    return np.where(scarce, there / wanted * CAUTIOUS, F(1)).astype(F)


def _excess(d: Counts, limit: Counts) -> Counts:
    return np.maximum(d - limit, 0) - np.maximum(-d - limit, 0)


def _slanted(axial: Counts, slanted: bool) -> Counts:
    return (axial.astype(F) * F(1.41421356)).astype(np.int32) if slanted else axial
