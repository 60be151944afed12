"""Droplet erosion in NumPy: the readable definition, and the oracle of ``droplet.cl``.

All drops of a batch take their steps side by side; what they do to the ground is added up in
integers, so that their order does not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit_erosion.droplet.plan import (
    BITE,
    CAPACITY,
    COUNTS,
    DIP,
    DRY,
    EAST,
    ENERGY,
    GOES_ON,
    LEAST_SLOPE,
    MOST,
    NORTH,
    PARTS,
    RISE,
    SEA,
    SETTLED,
    SOUTH,
    SPEED_GAINED,
    SPEED_KEPT,
    TAKEN,
    WATER_KEPT,
    WEST,
)

F = np.float32
I = np.int32  # noqa: E741
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]
BELOW_ONE = F(0.99999994)


@dataclass
class Drops:
    """Where drops are and where they go; one entry for each drop."""

    row: Counts
    col: Counts
    down: Floats
    right: Floats
    south: Floats
    east: Floats
    above: Floats
    rise: Floats
    depth: Floats
    idle: Counts

    def chosen(self, which: NDArray[np.bool_]) -> Drops:
        """Return some of the drops."""
        return Drops(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def nearest(self, cols: int) -> Counts:
        """Return the number of the sample that each drop is nearest to."""
        return (self.row + (self.down >= F(0.5))) * I(cols) + self.col + (self.right >= F(0.5))


@dataclass(frozen=True)
class Ground:
    """What drops walk on; heights in quanta."""

    height: Counts
    level: Counts | None
    receiver: Counts | None
    keep: np.float32
    sea: int
    is_open: bool
    patience: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.height.shape  # type: ignore[return-value]


def begin(
    seed: tuple[int, int], batch: int, parts: tuple[int, int], shape: tuple[int, int]
) -> Drops:
    """Return the drops of a batch where they fall: each somewhere in its own part of the map."""
    slot = np.arange(parts[0] * parts[1])
    bits = exact.hashed(seed, batch, slot)
    row, down = _place(slot // parts[1], parts[0], bits, shape[0] - 1)
    other = exact.mix(bits ^ np.uint32(0x9E3779B9))
    col, right = _place(slot % parts[1], parts[1], other, shape[1] - 1)
    zeros = np.zeros((5, len(slot)), dtype=F)
    return Drops(row, col, down, right, *zeros, np.zeros(len(slot), dtype=I))


def step(drops: Drops, ground: Ground) -> Counts:
    """Move drops, in place, by one step; return how the walk of each goes on.

    It depends on the ground alone, not on speed, water or load, so that both walks of a batch take
    the same way.
    """
    rows, cols = ground.shape
    height = ground.height.ravel()
    nearest = drops.nearest(cols)
    corner = drops.row * I(cols) + drops.col
    base = height[corner]
    b = (height[corner + 1] - base).astype(F)
    c = (height[corner + cols] - base).astype(F)
    d = (height[corner + cols + 1] - base).astype(F)
    to_east = b + (d - c - b) * drops.down
    to_south = c + (d - b - c) * drops.right
    upper = b * drops.right
    lower = c + (d - c) * drops.right
    here = upper + (lower - upper) * drops.down

    surface = np.full(len(base), ground.sea, dtype=I)
    in_lake = np.zeros(len(base), dtype=bool)
    if ground.level is not None:
        level = ground.level.ravel()[nearest]
        in_lake = level > height[nearest]
        surface = np.where(in_lake, level, surface)
    depth = (surface - base).astype(F) - here
    wet = depth > F(0)
    drops.depth = np.where(wet, depth, F(0))

    _follow(drops, ground, nearest, in_lake)
    steep = np.sqrt(to_east * to_east + to_south * to_south)
    turned = ~in_lake & ~wet & (steep > F(0))
    turn = (F(1) - ground.keep) / np.where(turned, steep, F(1))
    east = ground.keep * drops.east - turn * to_east
    south = ground.keep * drops.south - turn * to_south
    length = np.sqrt(east * east + south * south)
    turned &= length > F(1e-6)
    length = np.where(turned, length, F(1))
    drops.east = np.where(turned, _flushed(east / length), drops.east)
    drops.south = np.where(turned, _flushed(south / length), drops.south)
    _follow(drops, ground, nearest, (drops.east == F(0)) & (drops.south == F(0)))
    moves = (drops.east != F(0)) | (drops.south != F(0))

    before = (drops.row, drops.col, drops.down, drops.right)
    everywhere = np.ones_like(wet)
    _shift(drops, everywhere)
    side = _side(drops, rows, cols)
    rise = _height(drops, height, base, side == GOES_ON, cols) - here
    if ground.receiver is not None:  # a pit between samples
        again = (side == GOES_ON) & ~in_lake & ~wet & (rise >= F(0))
        for name, value in zip(("row", "col", "down", "right"), before, strict=True):
            setattr(drops, name, np.where(again, value, getattr(drops, name)))
        _follow(drops, ground, nearest, again)
        _shift(drops, again)
        side = np.where(again, _side(drops, rows, cols), side)
        repeated = _height(drops, height, base, side == GOES_ON, cols) - here
        rise = np.where(again, repeated, rise)
    if ground.is_open:  # the slope goes on beyond the border
        beyond = to_east * drops.east + to_south * drops.south
        rise = np.where(side == GOES_ON, rise, beyond)
    else:
        _return(drops, rows, cols)
        returned = _height(drops, height, base, everywhere, cols) - here
        rise = np.where(side == GOES_ON, rise, returned)
        side = np.full_like(side, GOES_ON)
    drops.rise = np.where(moves, rise, F(0))

    above = drops.above + rise
    lowest = (above < F(0)) | in_lake
    drops.above = np.where(lowest, F(0), above)
    drops.idle = np.where(lowest, I(0), drops.idle + I(1))
    ended = np.where(wet, I(SEA), I(DRY))
    goes = np.where(drops.idle <= I(ground.patience), I(GOES_ON), ended)
    end: Counts = np.where(moves, np.where(side == GOES_ON, goes, side), I(DRY))
    return end


def count(drops: Drops, ground: Ground, steps: int) -> Counts:
    """Return how often each place is visited: the first walk."""
    visits = np.zeros(ground.shape, dtype=I)
    for _ in range(steps):
        if len(drops.row) == 0:
            break
        np.add.at(visits.ravel(), drops.nearest(ground.shape[1]), I(1))
        drops = drops.chosen(step(drops, ground) == GOES_ON)
    return visits


@dataclass
class Changes:
    """What the drops of a batch do to the ground, parts; and what they take away."""

    pending: Counts
    cuts: Counts
    left: NDArray[np.int64]


def carry(
    drops: Drops,
    water: Floats,
    ground: Ground,
    visits: Counts,
    gives: Floats | None,
    settings: Floats,
    steps: int,
    is_laid_down: bool,
    changes: Changes,
) -> None:
    """Take up and lay down: the second walk.

    Parameters
    ----------
    drops, water
        The drops at their start, and the parts of water in each.
    ground
        What they walk on.
    visits
        Smoothed visits, sixteenths.
    gives
        How far the ground that the brush reaches gives way; None where it does wholly.
    settings
        See :mod:`terrakit_erosion.droplet.plan`.
    steps
        Longest walk.
    is_laid_down
        Whether a drop that ends lays its load down.
    changes
        What is added to.
    """
    cols = ground.shape[1]
    energy = np.full(len(water), settings[ENERGY], dtype=F)
    load = np.zeros(len(water), dtype=I)
    pending = changes.pending.ravel()

    def finish(drops: Drops, load: Counts, end: Counts) -> None:
        if is_laid_down:
            dry = end == DRY
            which = drops.chosen(dry)
            corner = which.row * I(cols) + which.col
            _scatter(pending, corner, cols, which.down, which.right, load[dry])
            load = np.where(dry, I(0), load)
        np.add.at(changes.left, end, load.astype(np.int64))

    for _ in range(steps):
        if len(drops.row) == 0:
            break
        corner = drops.row * I(cols) + drops.col
        down, right = drops.down, drops.right
        guard = F(COUNTS) / visits.ravel()[drops.nearest(cols)].astype(F)
        end = step(drops, ground)
        slope = -drops.rise * settings[RISE]
        carried = load.astype(F)

        room = drops.depth * settings[DIP] * guard
        in_water = _least(carried * settings[SETTLED], room)
        steep = np.where(slope > settings[LEAST_SLOPE], slope, settings[LEAST_SLOPE])
        capacity = _least(settings[CAPACITY] * steep * np.sqrt(energy) * water, F(MOST))
        uphill = _least(carried, drops.rise * settings[DIP] * guard)
        excess = _least((carried - capacity) * settings[SETTLED], steep * settings[BITE] * guard)
        wanted = _least((capacity - carried) * settings[TAKEN], slope * settings[BITE] * guard)
        wet, rises = drops.depth > F(0), drops.rise > F(0)
        full = carried > capacity
        laid = np.where(wet, in_water, np.where(rises, uphill, excess))
        takes = ~wet & ~rises & ~full
        laid = np.where(takes, F(0), laid).astype(I)
        wanted = np.where(takes, wanted, F(0))
        if gives is None:
            laid -= wanted.astype(I)
        else:
            load = load + _take(changes.cuts.ravel(), gives, corner, cols, down, right, wanted)
        gained = energy * settings[SPEED_KEPT] + slope * settings[SPEED_GAINED]
        energy = np.where(~wet & (gained > F(1e-20)), gained, F(0))
        load = load - laid
        _scatter(pending, corner, cols, down, right, laid)
        water = water * settings[WATER_KEPT]

        over = end != GOES_ON
        finish(drops.chosen(over), load[over], end[over])
        drops, water, energy, load = drops.chosen(~over), water[~over], energy[~over], load[~over]
    in_sea = (drops.depth > F(0)) if ground.level is None else np.zeros(len(load), dtype=bool)
    finish(drops, load, np.where(in_sea, I(SEA), I(DRY)))


# --- the brush ----------------------------------------------------------------------------------


def smooth(visits: Counts, weights: Floats) -> Counts:
    """Return how many visits a place shares its ground with, 1 or more, sixteenths."""
    total = visits.astype(F)
    for axis in (1, 0):
        own = visits if axis == 1 else total
        total = own.astype(F)
        for k in range(1, len(weights)):
            total = total + _beside(own, k, axis).astype(F) * weights[k]
    counted = total * F(COUNTS)
    held = np.where(counted < F(1e9), counted, F(1e9))
    result: Counts = np.where(held > F(COUNTS), held, F(COUNTS)).astype(I)
    return result


def spread(pending: Counts, weights: Floats) -> Counts:
    """Return what is pending, spread along rows and columns; the sum stays the same."""
    for axis in (1, 0):
        total = pending.copy()
        for k in range(1, len(weights)):
            gives = (pending.astype(F) * weights[k]).astype(I)
            for here, there in _both(pending.shape, k, axis):
                total[here] += gives[there] - gives[here]
        pending = total
    return pending


def apply(
    total: Counts, height: Counts, loose: Counts, held: Counts | None
) -> tuple[Counts, Counts, Counts, NDArray[np.int64]]:
    """Return heights, loose material, what stays pending, and what held points pass on.

    Parameters
    ----------
    total
        What each point gets, parts.
    height, loose
        Heights and loose material now, quanta.
    held
        Which points keep their height; None where none does.
    """
    whole = np.sign(total) * (np.abs(total) // I(PARTS))
    rest = total - whole * I(PARTS)
    passed = np.zeros(total.shape, dtype=np.int64)
    if held is not None:
        passed = np.where(held, total, 0).astype(np.int64)
        whole, rest = np.where(held, I(0), whole), np.where(held, I(0), rest)
    return height + whole, np.maximum(loose + whole, I(0)), rest, passed


# --- banks and plains ---------------------------------------------------------------------------


def rest(
    height: Counts,
    loose: Counts,
    bed: Floats | None,
    bank: tuple[int, int],
    slumps: np.float32,
    levels: np.float32,
    held: NDArray[np.bool_] | None,
) -> tuple[Counts, Counts, NDArray[np.int64]]:
    """Return heights, loose material and what held points pass on after one sweep.

    Banks steeper than they can stand slump; loose material levels out as far as there is any.

    Parameters
    ----------
    height, loose
        Heights and loose material now, quanta.
    bed
        How far bedrock gives way; None where it does wholly.
    bank
        Difference to an axial and a diagonal neighbour that stands, quanta.
    slumps, levels
        Share of the excess over it, and of the whole difference, that an axial neighbour gets; a
        diagonal one gets a quarter of that.
    held
        Which points keep their height; None where none does.
    """
    flux = np.zeros_like(height)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        slanted = down != 0 and right != 0
        quarter = F(0.25) if slanted else F(1)
        here, there = _apart(height.shape, down, right)
        d = height[here] - height[there]
        fall = np.abs(d)
        donor = np.where(d > 0, loose[here], loose[there]).astype(F)
        beyond = np.maximum(fall - I(bank[slanted]), I(0))
        gives = np.ones(1, dtype=F) if bed is None else np.where(d > 0, bed[here], bed[there])
        slope_share = slumps * quarter * _least(gives, F(1))
        slumped = (slope_share * beyond.astype(F)).astype(I)
        level, most = levels * quarter * fall.astype(F), donor * F(0.1)
        amount = slumped + np.where(level < most, level, most).astype(I)
        amount = np.where(d > 0, amount, -amount)
        flux[here] += amount
        flux[there] -= amount
    passed = np.zeros(height.shape, dtype=np.int64)
    if held is not None:
        passed = np.where(held, flux, 0).astype(np.int64) * -PARTS
        flux = np.where(held, I(0), flux)
    return height - flux, np.maximum(loose - flux, I(0)), passed


# --- hard ground --------------------------------------------------------------------------------


def soften(height: Counts, loose: Counts, bed: Floats, shield: np.float32) -> Floats:
    """Return how far each point gives way.

    Bedrock gives way by its softness, and loose material wholly, unless it is so thin that a batch,
    which lowers no place by more than ``shield`` times the fall to a neighbour, could take all.
    """
    steepest = np.ones_like(height)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here, there = _apart(height.shape, down, right)
        fall = np.abs(height[here] - height[there])
        steepest[here] = np.maximum(steepest[here], fall)
        steepest[there] = np.maximum(steepest[there], fall)
    thick = loose.astype(F)
    share = thick / (thick + shield * steepest.astype(F))
    gives = _least(bed, F(2))
    return gives + (F(1) - gives) * share


def reach(soft: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the sums of the brush over ``soft``: within columns, and within the whole brush."""
    sums = []
    for axis in (0, 1):
        total = soft * weights[0]
        for k in range(1, len(weights)):
            total = total + _beside(soft, k, axis) * weights[k]
        sums.append(total)
        soft = total
    return sums[0], sums[1]


def cut(
    cuts: Counts, soft: Floats, column: Floats, gives: Floats, weights: Floats
) -> tuple[Counts, Counts]:
    """Return what each point loses, and the cuts that rounding left over.

    Cuts are shared in proportion to how far the points that the brush reaches give way.
    """
    unit = _unit(cuts, gives)
    shared = cuts.copy()
    for k in range(1, len(weights)):
        for here, there in _both(cuts.shape, k, 1):
            shared[here] += (unit[there] * weights[k] * column[here]).astype(I)
            shared[here] -= (unit[here] * weights[k] * column[there]).astype(I)
    unit = _unit(shared, column)
    lost = (unit * weights[0] * soft).astype(I)
    given = lost.copy()
    for k in range(1, len(weights)):
        for here, there in _both(cuts.shape, k, 0):
            lost[here] += (unit[there] * weights[k] * soft[here]).astype(I)
            given[here] += (unit[here] * weights[k] * soft[there]).astype(I)
    return lost, shared - given


# --- parts of the above -------------------------------------------------------------------------


def _least(a: Floats, b: Floats | np.float32) -> Floats:
    return np.where(a < b, a, b)


def _flushed(values: Floats) -> Floats:
    """Return values without what is so small that its square is no normal float."""
    return np.where((values > F(-1e-10)) & (values < F(1e-10)), F(0), values)


def _place(
    part: NDArray[np.int64], parts: int, bits: NDArray[np.uint32], cells: int
) -> tuple[Counts, Floats]:
    """Return where along an axis drops fall, as cell and fraction."""
    whole = (part.astype(np.uint64) << np.uint64(32)) + bits
    place = whole * np.uint64(cells) // np.uint64(parts)
    return (place >> np.uint64(32)).astype(I), exact.uniform(place.astype(np.uint32))


def _follow(drops: Drops, ground: Ground, nearest: Counts, which: NDArray[np.bool_]) -> None:
    """Point some drops to the neighbour by which water leaves the nearest point."""
    if ground.receiver is None:
        return
    cols = ground.shape[1]
    away = ground.receiver.ravel()[nearest] - nearest
    rows = np.where(away > 1, I(1), np.where(away < -1, I(-1), I(0)))
    south = ((drops.down >= F(0.5)) + rows).astype(F) - drops.down
    east = ((drops.right >= F(0.5)) + (away - rows * I(cols))).astype(F) - drops.right
    length = np.sqrt(south * south + east * east)
    leads = which & (away != 0) & (length > F(1e-6))
    length = np.where(leads, length, F(1))
    drops.south = np.where(leads, _flushed(south / length), drops.south)
    drops.east = np.where(leads, _flushed(east / length), drops.east)


def _shift(drops: Drops, which: NDArray[np.bool_]) -> None:
    """Move some drops by one step along their direction."""
    for cell, place, direction in (("row", "down", "south"), ("col", "right", "east")):
        now = getattr(drops, place)
        then = now + getattr(drops, direction)
        cells = np.where(then < F(0), I(-1), np.where(then >= F(1), I(1), I(0)))
        then = _flushed(then - cells.astype(F))
        then = np.where(then < BELOW_ONE, then, BELOW_ONE)
        setattr(drops, cell, np.where(which, getattr(drops, cell) + cells, getattr(drops, cell)))
        setattr(drops, place, np.where(which, then, now))


def _side(drops: Drops, rows: int, cols: int) -> Counts:
    """Return the side over which each drop is beyond the border, or that it is not."""
    sides = (drops.row < 0, drops.row > rows - 2, drops.col < 0, drops.col > cols - 2)
    return np.select(sides, [I(NORTH), I(SOUTH), I(WEST), I(EAST)], I(GOES_ON)).astype(I)


def _return(drops: Drops, rows: int, cols: int) -> None:
    """Bring drops that went over a closed border back to it."""
    for cell, place, last in (("row", "down", rows - 2), ("col", "right", cols - 2)):
        number = getattr(drops, cell)
        low, high = number < 0, number > last
        share = np.where(low, F(0), np.where(high, BELOW_ONE, getattr(drops, place)))
        setattr(drops, place, share)
        setattr(drops, cell, np.where(low, I(0), np.where(high, I(last), number)))


def _height(
    drops: Drops, height: Counts, base: Counts, which: NDArray[np.bool_], cols: int
) -> Floats:
    """Return the height above ``base`` of the drops that are inside, and of others anything."""
    corner = np.where(which, drops.row * I(cols) + drops.col, I(0))
    a, b, c, d = ((height[corner + k] - base).astype(F) for k in (0, 1, cols, cols + 1))
    upper = a + (b - a) * drops.right
    lower = c + (d - c) * drops.right
    return upper + (lower - upper) * drops.down


def _shares(down: Floats, right: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    up, left = F(1) - down, F(1) - right
    return up * left, up * right, down * left, down * right


def _scatter(
    pending: Counts, corner: Counts, cols: int, down: Floats, right: Floats, amount: Counts
) -> None:
    """Add amounts to the four corners around each place; the last takes what rounding left."""
    whole = amount.astype(F)
    a, b, c = ((whole * share).astype(I) for share in _shares(down, right)[:3])
    for offset, part in ((0, a), (1, b), (cols, c), (cols + 1, amount - a - b - c)):
        np.add.at(pending, corner + I(offset), part)


def _take(
    cuts: Counts,
    gives: Floats,
    corner: Counts,
    cols: int,
    down: Floats,
    right: Floats,
    wanted: Floats,
) -> Counts:
    """Cut the four corners as far as the ground gives way; return what was taken."""
    taken = np.zeros_like(corner)
    for offset, share in zip((0, 1, cols, cols + 1), _shares(down, right), strict=True):
        part = (wanted * share * gives.ravel()[corner + I(offset)]).astype(I)
        np.subtract.at(cuts, corner + I(offset), part)
        taken += part
    return taken


def _unit(cuts: Counts, gives: Floats) -> Floats:
    """Return what a cut takes for each unit of weight and of giving way."""
    some = gives > F(1e-6)
    return np.where(some, cuts.astype(F) / np.where(some, gives, F(1)), F(0))


Part = tuple[slice, slice]


def _both(shape: tuple[int, ...], k: int, axis: int) -> list[tuple[Part, Part]]:
    """Return where a point has a neighbour ``k`` away along an axis, and where that one is."""
    if k >= shape[axis]:
        return []
    near, far = [slice(None), slice(None)], [slice(None), slice(None)]
    near[axis], far[axis] = slice(k, None), slice(None, -k)
    return [((near[0], near[1]), (far[0], far[1])), ((far[0], far[1]), (near[0], near[1]))]


def _beside(values: NDArray[np.generic], k: int, axis: int) -> NDArray[np.generic]:
    """Return the sum of the two values ``k`` away along an axis; 0 beyond the border."""
    low, high = np.zeros_like(values), np.zeros_like(values)
    pairs = _both(values.shape, k, axis)
    if pairs:
        low[pairs[0][0]] = values[pairs[0][1]]
        high[pairs[1][0]] = values[pairs[1][1]]
    return low + high


def _apart(shape: tuple[int, ...], down: int, right: int) -> tuple[Part, Part]:
    """Return where a point has a neighbour so far away, and where that neighbour is."""
    rows, cols = shape
    west, east = max(0, -right), cols - max(0, right)
    here = slice(0, rows - down), slice(west, east)
    return here, (slice(down, rows), slice(west + right, east + right))
