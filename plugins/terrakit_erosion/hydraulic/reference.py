"""Water and sediment in NumPy: the readable definition, and the oracle of ``hydraulic.cl``.

Fields have a frame of two cells around the map (and a row that nothing reads), and edges are
numbered by the cell that they leave: see ``hydraulic.cl``. Counts are whole numbers of quanta.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact

F = np.float32
Counts = NDArray[np.int32]
Floats = NDArray[np.float32]

FULL = 2**29
"""Counts of water or load that a cell can hold."""
WALL = 2**30
"""Height of a closed border."""
THIN = F(1e-5)
"""Depth that does not flow, m."""
STILL = F(1e-12)
"""Discharge that counts as none, m2/s."""
LEAST = F(1e-6)
"""Counts that count as none."""
MUD = F(0.5)
"""Creep under water, of that under raindrops."""
SPARE = 4
STORM_FROM = F(0.55)
STORM_PEAK = F(20.37)


class Flow(NamedTuple):
    """Constants of pass 1; the diagonal edges are longer by the square root of 2."""

    bed_quantum: np.float32
    water_quantum: np.float32
    bed_slope: np.float32
    """Slope of one count of the bed between neighbours."""
    water_slope: np.float32
    bed_slant: np.float32
    water_slant: np.float32
    push: np.float32
    """g times the time between two pushes."""
    drag: np.float32
    """4 g n^2 times that time."""
    wave_depth: np.float32
    calming: np.float32
    """Share of the last rise of deep water that counts as if it were higher."""
    inverse_friction: np.float32
    """1 / n^2."""
    critical: np.float32
    """g times the square of the Froude number up to which friction need not balance."""
    empty: np.float32
    """Speed that empties a cell in a step, m/s."""
    empty_slant: np.float32


class Pipe(NamedTuple):
    """Constants of pass 1 of the virtual pipes."""

    water_quantum: np.float32
    bed_slope: np.float32
    water_slope: np.float32
    bed_slant: np.float32
    water_slant: np.float32
    push: np.float32
    """g times the height of a pipe times the time between two pushes."""
    empty: np.float32
    empty_slant: np.float32


class Transfer(NamedTuple):
    """Constants of what passes edges, along the axes or the diagonals."""

    rate: np.float32
    """Counts that a discharge of 1 m2/s moves in a step."""
    available: np.float32
    """Share of the water that may leave in a step."""
    spread: np.float32
    """Share of a difference that mixing moves in a step."""


class Ground(NamedTuple):
    """Constants of erosion and deposition."""

    unit: np.float32
    """Discharge of one count through a diagonal edge in a step, m2/s."""
    bed_slope: np.float32
    water_slope: np.float32
    bed_slant: np.float32
    water_slant: np.float32
    water_quantum: np.float32
    friction: np.float32
    """Manning's n."""
    capacity: np.float32
    """Counts of load that a power of 1 m2/s carries."""
    least_slope: np.float32
    threshold: np.float32
    erosion_share: np.float32
    deposition_share: np.float32


class Turns(NamedTuple):
    """Where this step rounds: rain by a whole number below 32, the others by a share of 1."""

    rain: np.int32
    water: np.float32
    load: np.float32
    bed: np.float32


class State(NamedTuple):
    """What moves, with its frame."""

    bed: Counts
    depth: Counts
    load: Counts


Edges = tuple[Floats, Floats]


class Window:
    """The map within its frame, shifted by an offset."""

    def __init__(self, rows: int, cols: int) -> None:
        self.rows, self.cols = rows, cols
        self.stride = cols + 4

    def __call__(self, field: NDArray[Any], offset: int = 0) -> NDArray[Any]:
        """Return the neighbours at ``offset`` of every cell of the map."""
        start = 2 * self.stride + 2 + offset
        part = field.reshape(-1)[start : start + self.rows * self.stride]
        return part.reshape(self.rows, self.stride)[:, : self.cols]

    @property
    def families(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Offsets of the two edges of a cell: along the axes, and along the diagonals."""
        return (1, self.stride), (self.stride + 1, self.stride - 1)


def inverse_cube_root(h: Floats) -> Floats:
    """Return ``h ** (-1/3)`` for positive numbers, within 2e-7."""
    third = h * F(0.33333334)
    guess = 1419967116 - (h.view(np.int32).astype(F) * F(0.33333334)).astype(np.int32)
    r: Floats = guess.astype(np.int32).view(F)
    for _ in range(3):
        r = r * (F(1.3333334) - third * (r * r * r))
    return r


def slope(
    bi: Counts, bj: Counts, di: Counts, dj: Counts, bed_slope: Any, water_slope: Any
) -> Floats:
    """Return the fall of the water surface from i to j over their distance, -1 to 1."""
    s = (bi - bj).astype(F) * bed_slope + (di - dj).astype(F) * water_slope
    return np.where(s > F(1), F(1), np.where(s < F(-1), F(-1), s))


def push(
    edges: tuple[Edges, Edges], state: State, before: Counts, flow: Flow, window: Window
) -> None:
    """Accelerate the discharge through every edge (local inertia, implicit Manning friction).

    With h the depth over the higher bed, S the fall of the surface and w the wave depth::

        q' = 2 X / (1 + sqrt(1 + 4 B X)),  X = |q + g t min(h, w) S|,
        B = g t n^2 min(h, w) / h^(10/3)

    is the positive root of ``q' + B q'^2 = X``. Beyond half the critical discharge the flow is no
    faster than Manning's, ``h^(5/3) sqrt(S) / n``, since inertia alone would break into waves.

    Water deeper than the wave depth has nothing that stops its waves. There S also counts part of
    what the surface rose since the last push (``before``), which calms the short ones and leaves
    steady flow as it is.
    """
    slopes = (flow.bed_slope, flow.water_slope, flow.empty)
    slants = (flow.bed_slant, flow.water_slant, flow.empty_slant)
    whole = (window.rows + 3) * window.stride
    for family, lengths, steps in zip(edges, (slopes, slants), window.families, strict=True):
        bed_slope, water_slope, empty = lengths
        for q, step in zip(family, steps, strict=True):
            here, there = slice(0, whole), slice(step, whole + step)
            bi, bj = state.bed.reshape(-1)[here], state.bed.reshape(-1)[there]
            di, dj = state.depth.reshape(-1)[here], state.depth.reshape(-1)[there]
            hi = di.astype(F) * flow.water_quantum
            hj = dj.astype(F) * flow.water_quantum
            drop = (bi - bj).astype(F) * flow.bed_quantum
            fall = slope(bi, bj, di, dj, bed_slope, water_slope)
            lower, upper = np.maximum(hi, hj - drop), np.maximum(hj, hi + drop)
            deep = np.where(drop > F(0), lower, upper)
            h = np.where(deep < THIN, THIN, deep)
            r = inverse_cube_root(h)
            r2 = r * r
            r4 = r2 * r2
            light = np.minimum(h, flow.wave_depth)
            risen = (di - before.reshape(-1)[here]) - (dj - before.reshape(-1)[there])
            swell = np.where(h > light, flow.calming * (risen.astype(F) * water_slope), F(0))
            pushed = q.reshape(-1)[here] + flow.push * light * (fall + swell)
            x = np.abs(pushed)
            after = F(2) * x / (F(1) + np.sqrt(F(1) + flow.drag * light * (r4 * r4 * r2) * x))
            h3 = h * h * h
            manning = np.abs(fall) * (h3 * h * r2) * flow.inverse_friction
            after = np.minimum(after, np.sqrt(np.maximum(manning, flow.critical * h3)))
            after = np.minimum(after, np.where(pushed > F(0), hi, hj) * empty)
            after = np.where((deep < THIN) | (after < STILL), F(0), after)
            q.reshape(-1)[here] = np.where(pushed > F(0), after, -after)


def pump(edges: tuple[Edges, Edges], state: State, pipe: Pipe, window: Window) -> None:
    """Accelerate the water in pipes between the cells (Mei 2007): no depth, no friction."""
    slopes = (pipe.bed_slope, pipe.water_slope, pipe.empty)
    slants = (pipe.bed_slant, pipe.water_slant, pipe.empty_slant)
    whole = (window.rows + 3) * window.stride
    for family, lengths, steps in zip(edges, (slopes, slants), window.families, strict=True):
        bed_slope, water_slope, empty = lengths
        for q, step in zip(family, steps, strict=True):
            here, there = slice(0, whole), slice(step, whole + step)
            bi, bj = state.bed.reshape(-1)[here], state.bed.reshape(-1)[there]
            di, dj = state.depth.reshape(-1)[here], state.depth.reshape(-1)[there]
            fall = (bi - bj).astype(F) * bed_slope + (di - dj).astype(F) * water_slope
            pushed = q.reshape(-1)[here] + pipe.push * fall
            after = np.where(np.abs(pushed) < STILL, F(0), pushed)
            from_there = np.where(after > F(0), di.astype(F), dj.astype(F))
            most = from_there * pipe.water_quantum * empty
            kept = np.where(after > most, most, np.where(after < -most, -most, after))
            q.reshape(-1)[here] = kept


def share(depth: Counts, outward: tuple[Floats, ...], transfer: Transfer) -> Floats:
    """Return the share of what wants to leave a cell that does: never more than there is."""
    e, w, s, n = (np.maximum(q, F(0)) for q in outward)
    wanted = transfer.rate * ((e + w) + (s + n))
    left = depth - (depth >> 20) - SPARE
    have = np.maximum(left, 0).astype(F) * transfer.available
    scarce = wanted > have
    return np.where(scarce, have / np.where(scarce, wanted, F(1)), F(1))


def concentration(load: Counts, depth: Counts) -> Floats:
    """Return the suspended load to a count of water."""
    moving = load - (load >> 20) - 2 * SPARE
    result: Floats = np.maximum(moving, 0).astype(F) / np.maximum(depth, 1).astype(F)
    return result


def through(q: Floats, rate: np.float32, shared: Floats) -> Floats:
    """Return the size of the flow through an edge, in counts."""
    size = np.abs(q) * rate * shared
    return np.where(size < LEAST, F(0), size)


def whole_counts(size: Floats, threshold: np.float32, held_beyond: Counts) -> Counts:
    """Return the counts that pass an edge, from the size of the flow and the room beyond."""
    count = (size + threshold).astype(np.int32)
    room = np.maximum((FULL - held_beyond) >> 2, 0)
    return np.minimum(count, room).astype(np.int32)


def mixed(
    q: Floats, size: Floats, c: Floats, beyond: Floats, spread: np.float32, shallow: Counts
) -> Floats:
    """Return the load that passes an edge outward: with the water, and by mixing."""
    carried = np.where(q > F(0), size * c, -size * beyond)
    result: Floats = carried + spread * shallow.astype(F) * (c - beyond)
    return result


def outward(edges: Edges, window: Window, steps: tuple[int, int], offset: int) -> Any:
    """Return the discharge out of the cells at ``offset`` through their four edges."""
    one, other = steps
    return (
        window(edges[0], offset),
        -window(edges[0], offset - one),
        window(edges[1], offset),
        -window(edges[1], offset - other),
    )


def carry(
    state: State,
    edges: Edges,
    steps: tuple[int, int],
    rain: Counts,
    turns: Turns,
    transfer: Transfer,
    window: Window,
) -> tuple[Counts, Counts, tuple[Floats, ...]]:
    """Move water and load through the edges of one family.

    Returns depth and load after, and the signed outward size of what passed the four edges.
    """
    _, d, m = (window(field) for field in state)
    c = concentration(m, d)
    own = share(d, outward(edges, window, steps, 0), transfer)
    flows = outward(edges, window, steps, 0)
    offsets = (steps[0], -steps[0], steps[1], -steps[1])
    water, carried, signed = [], [], []
    for q, offset in zip(flows, offsets, strict=True):
        _, dj, mj = (window(field, offset) for field in state)
        theirs = share(dj, outward(edges, window, steps, offset), transfer)
        size = through(q, transfer.rate, np.where(q > F(0), own, theirs))
        count = whole_counts(size, turns.water, np.where(q > F(0), dj, d))
        load = mixed(q, size, c, concentration(mj, dj), transfer.spread, np.minimum(d, dj))
        grains = whole_counts(np.abs(load), turns.load, np.where(load > F(0), mj, m))
        water.append(np.where(q > F(0), count, -count))
        carried.append(np.where(load > F(0), grains, -grains))
        signed.append(np.where(q > F(0), size, -size))
    depth = d - ((water[0] + water[1]) + (water[2] + water[3])) + ((rain + turns.rain) >> 5)
    load_after = m - ((carried[0] + carried[1]) + (carried[2] + carried[3]))
    return depth, load_after, tuple(signed)


def work(
    state: State,
    after: State,
    rock: Counts,
    edges: tuple[Edges, Edges],
    rain: Counts,
    softness: Floats,
    turns: Turns,
    transfer: Transfer,
    ground: Ground,
    thin: int,
    shift: int,
    window: Window,
) -> None:
    """Move water and load through the diagonal edges, then erode or lay down.

    Capacity is that of the power of the stream, the smaller of what the surface gives and what
    friction takes::

        C = K max(min(max(q sin a, q s), n^2 q^3 / d^(10/3)) - P, 0)

    with ``q sin a`` the mean over the edges of both families.
    """
    axes, diagonals = window.families
    depth, load, diagonal = carry(state, edges[1], diagonals, rain, turns, transfer, window)
    b, d, _ = (window(field) for field in state)
    axial = outward(edges[0], window, axes, 0)
    beds, tops, worked, falls = [], [], [], []
    for flows, steps, bed_fall, water_fall in (
        (axial, axes, ground.bed_slope, ground.water_slope),
        (diagonal, diagonals, ground.bed_slant, ground.water_slant),
    ):
        for q, offset in zip(flows, (steps[0], -steps[0], steps[1], -steps[1]), strict=True):
            bj, dj = window(state.bed, offset), window(state.depth, offset)
            beds.append(bj)
            tops.append(np.where(bj == WALL, -WALL, bj + (dj >> shift)))
            falls.append(slope(b, bj, d, dj, bed_fall, water_fall))
            worked.append(np.abs(q) * np.abs(falls[-1]))

    # Capacity
    along_axes = (worked[0] + worked[1]) + (worked[2] + worked[3])
    slanted = (worked[4] + worked[5]) + (worked[6] + worked[7])
    power = F(0.25) * (along_axes + slanted * ground.unit)
    rise_x, rise_y = F(0.5) * (falls[0] - falls[1]), F(0.5) * (falls[2] - falls[3])
    sine = power / np.sqrt(F(1) + (rise_x * rise_x + rise_y * rise_y))
    one_way, other_way = diagonal[0] - diagonal[1], diagonal[2] - diagonal[3]
    half_unit = F(0.35355339) * ground.unit
    across = F(0.25) * (axial[0] - axial[1]) + F(0.5) * (half_unit * (one_way - other_way))
    down = F(0.25) * (axial[2] - axial[3]) + F(0.5) * (half_unit * (one_way + other_way))
    across = np.where(np.abs(across) < F(1e-15), F(0), across)
    down = np.where(np.abs(down) < F(1e-15), F(0), down)
    passing = np.sqrt(across * across + down * down)
    driven = np.maximum(sine, ground.least_slope * passing)
    r = inverse_cube_root(np.maximum(d.astype(F) * ground.water_quantum, THIN))
    r2 = r * r
    fell = np.maximum(passing * (r2 * r2 * r) * ground.friction, F(1e-10))
    spare = np.minimum(driven, passing * (fell * fell)) - ground.threshold
    held = ground.capacity * np.maximum(spare, F(0))
    able = np.where(held < F(0.001), F(0), np.minimum(held, F(2**28)))
    short_of = able - load.astype(F)

    # Erode: never below the lowest neighbour
    low = np.minimum.reduce(beds)
    fall = np.where(b > low, (b - low) >> 3, 0).astype(np.int32)
    wanted = (np.maximum(short_of, F(0)) * ground.erosion_share + turns.bed).astype(np.int32)
    cut = np.minimum(wanted, fall)
    dry = depth < thin
    of_loose = np.minimum(cut, b - window(rock))
    of_rock = ((cut - of_loose).astype(F) * softness + turns.bed).astype(np.int32)
    eroded = np.where(dry, 0, of_loose + np.minimum(of_rock, fall << 2))

    # Lay down: never above the water beside it
    top = np.maximum.reduce(tops)
    gap = np.where(top > b, (top - b) >> 1, 0).astype(np.int32)
    settling = (np.maximum(-short_of, F(0)) * ground.deposition_share + turns.bed).astype(np.int32)
    laid = np.where(dry, load, np.minimum(np.minimum(settling, gap), load))

    window(after.bed)[:] = b - eroded + laid
    window(after.depth)[:] = depth
    window(after.load)[:] = load + eroded - laid
    window(rock)[:] = np.minimum(window(rock), window(after.bed))


def ring(window: Window) -> NDArray[np.intp]:
    """Return the frame's inner ring: north and south with the corners, then west and east."""
    rows, cols, stride = window.rows, window.cols, window.stride
    across, along = np.arange(1, cols + 3), np.arange(2, rows + 2) * stride
    return np.concatenate(
        (stride + across, (rows + 2) * stride + across, along + 1, along + cols + 2)
    )


def export(
    state: State,
    edges: Edges,
    steps: tuple[int, int],
    totals: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
    turns: Turns,
    transfer: Transfer,
    window: Window,
) -> None:
    """Add what passes the edge of the map: water that left and came, load that left."""
    one, other = steps
    bed, depth, load = (field.reshape(-1) for field in state)
    first, second = (field.reshape(-1) for field in edges)
    cells = ring(window)
    open_cells = np.flatnonzero(bed[cells] != WALL)
    k = cells[open_cells]

    def shared(i: NDArray[np.intp]) -> Floats:
        out = (first[i], -first[i - one], second[i], -second[i - other])
        return share(depth[i], out, transfer)

    d, m, c = depth[k], load[k], concentration(load[k], depth[k])
    own = shared(k)
    left, came, carried = (np.zeros(len(k), dtype=np.int64) for _ in range(3))
    for number, (field, offset) in enumerate(
        ((first, one), (first, -one), (second, other), (second, -other))
    ):
        j = k + offset
        row, col = j // window.stride - 2, j % window.stride - 2
        inside = (row >= 0) & (row < window.rows) & (col >= 0) & (col < window.cols)
        q = -field[j] if number % 2 else field[k]
        j = np.where(inside, j, k)
        size = through(q, transfer.rate, np.where(q > F(0), own, shared(j)))
        water = whole_counts(size, turns.water, np.where(q > F(0), depth[j], d))
        beyond = concentration(load[j], depth[j])
        moved = mixed(q, size, c, beyond, transfer.spread, np.minimum(d, depth[j]))
        grains = whole_counts(np.abs(moved), turns.load, np.where(moved > F(0), load[j], m))
        came += np.where(inside & (q > F(0)), water, 0)
        left += np.where(inside & ~(q > F(0)), water, 0)
        carried += np.where(inside, np.where(moved > F(0), -grains, grains), 0)
    for total, change in zip(totals, (left, came, carried), strict=True):
        total[open_cells] += change


def wrap(state: State, window: Window) -> None:
    """Fill the frame with the far side of the map."""
    rows, cols = window.rows, window.cols
    for field in state:
        inner = field[2 : rows + 2, 2 : cols + 2].copy()
        field[: rows + 4] = np.take(
            np.take(inner, np.arange(-2, rows + 2) % rows, axis=0),
            np.arange(-2, cols + 2) % cols,
            axis=1,
        )


def slump(
    state: State,
    after: State,
    rock: Counts,
    drowned: int,
    talus: int,
    slide: float,
    creep: float,
    window: Window,
    round_the_map: bool,
) -> None:
    """Let banks steeper than the talus slide, and ground creep, under water at half the rate."""
    b = window(state.bed)
    rows, cols, stride = window.rows, window.cols, window.stride
    row, col = np.arange(rows)[:, None], np.arange(cols)[None, :]
    slanted = int(np.float32(talus) * F(1.41421356))
    total = np.zeros((rows, cols), dtype=np.int32)
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            if dr == 0 and dc == 0:
                continue
            inside = (row + dr >= 0) & (row + dr < rows) & (col + dc >= 0) & (col + dc < cols)
            part, limit = (F(0.16666667), slanted) if dr and dc else (F(0.6666667), talus)
            d = b - window(state.bed, dr * stride + dc)
            size = np.abs(d)
            beyond = np.where(size > limit, size - limit, 0).astype(F)
            deep = np.minimum(window(state.depth), window(state.depth, dr * stride + dc))
            splash = F(creep) * part * np.where(deep > drowned, MUD, F(1))
            count = (F(slide) * part * beyond + splash * size.astype(F)).astype(np.int32)
            moved = np.where(d < 0, -count, count)
            total += moved if round_the_map else np.where(inside, moved, 0)
    window(after.bed)[:] = b - total
    window(rock)[:] = np.minimum(window(rock), window(after.bed))


def lose(depth: Counts, loss: Counts, window: Window) -> int:
    """Take a loss (of every cell or one) from the water; return the counts that were there."""
    d = window(depth)
    lost = np.minimum(loss, d)
    d -= lost
    return int(lost.sum(dtype=np.int64))


def level(state: State, sea: NDArray[np.uint8], surface: int, shift: int, window: Window) -> int:
    """Set the sea to its level; return the counts that it gave."""
    d = window(state.depth)
    above = np.maximum(surface - window(state.bed), 0)
    held = np.where(sea != 0, above << shift, d).astype(np.int32)
    given = int((held.astype(np.int64) - d).sum())
    d[:] = held
    return given


def passing(edges: tuple[Edges, Edges], window: Window) -> Floats:
    """Return the discharge through each cell, the mean of both families, m2/s."""
    stride = window.stride
    x = F(0.25) * (window(edges[0][0]) + window(edges[0][0], -1))
    y = F(0.25) * (window(edges[0][1]) + window(edges[0][1], -stride))
    u = F(0.1767767) * (window(edges[1][0]) + window(edges[1][0], -stride - 1))
    v = F(0.1767767) * (window(edges[1][1]) + window(edges[1][1], -stride + 1))
    across, down = x + (u - v), y + (u + v)
    across = np.where(np.abs(across) < F(1e-15), F(0), across)
    down = np.where(np.abs(down) < F(1e-15), F(0), down)
    result: Floats = np.sqrt(across * across + down * down)
    return result


def survey(
    depth: Counts,
    edges: tuple[Edges, Edges],
    wetness: Floats,
    discharge: Floats,
    wet: int,
    wetting: np.float32,
    weight: np.float32,
    window: Window,
) -> None:
    """Note how often a cell is wet, and the mean of what passes it."""
    is_wet = np.where(window(depth) >= wet, F(1), F(0))
    wetter = wetness + (is_wet - wetness) * wetting
    wetness[:] = np.where(wetter < LEAST, F(0), wetter)
    discharge += (passing(edges, window) - discharge) * weight


def storm(
    steady: Counts,
    cells: tuple[Counts, Counts],
    parts: tuple[Floats, Floats],
    seed: tuple[int, int],
    epoch: int,
    later: np.float32,
) -> Counts:
    """Return the rain of a block where storms pass: cells of a lattice that come and go."""
    a, b = cells[0][None, :], cells[1][:, None]
    u, v = parts[0][None, :], parts[1][:, None]
    at = []
    for t in (0, 1):
        low = (seed[0] + 0x9E3779B9 * (epoch + t)) & 0xFFFFFFFF

        def strength(i: Counts, j: Counts, low: int = low) -> Floats:
            i, j = np.broadcast_arrays(i, j)
            return exact.uniform(exact.hashed((low, seed[1]), i, j))

        nw, ne = strength(a, b), strength(a + 1, b)
        sw, se = strength(a, b + 1), strength(a + 1, b + 1)
        north, south = nw + (ne - nw) * u, sw + (se - sw) * u
        at.append(north + (south - north) * v)
    between = at[0] + (at[1] - at[0]) * later
    above = np.maximum(between - STORM_FROM, F(0))
    some = steady.astype(F) * (above * STORM_PEAK)
    return np.minimum(some, F(2**28)).astype(np.int32)
