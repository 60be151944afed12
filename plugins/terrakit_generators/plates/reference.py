"""Tectonic plates in NumPy: the readable definition, and the oracle of ``plates.cl``.

Lengths are in plate sizes, speeds in multiples of ``speed``, unless a name says metres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import check_cancelled, exact
from terrakit.noise.reference import gradient

F = np.float32
U = np.uint32
BLOCK = 32
"""Rows that are computed together, to bound the memory of the temporaries."""
NEAREST = 6
"""Sites that are kept; the last only says where the weight of the others ends."""
REACH = 2
"""Cells around its own in which a sample looks for its plates."""
FAR_REACH = 3
"""Cells around its own in which a sample looks for the boundary of its plate."""
LEAST = 2.0**-24
"""Shares below this are 0, so that no product gets too small for a normal float."""
LAYERS = (
    "elevation",
    "plate",
    "plate_type",
    "motion_east",
    "motion_north",
    "boundary_distance",
    "convergence",
    "shear",
    "boundary_class",
    "uplift",
)
NONE, COLLISION, SUBDUCTION, RIFT, RIDGE, TRANSFORM = range(6)

Floats = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Sites:
    """The sites of a rectangle of lattice cells, row by row from the south-west."""

    first: tuple[int, int]
    """Lattice column and row of the first cell."""
    shape: tuple[int, int]
    """Rows and columns of cells."""
    table: Floats
    """For every cell: place in it (2), weight, motion (2), spin, type, age."""
    identity: NDArray[np.int32]
    """For every cell: the plate's number, below 2^24."""


@dataclass(frozen=True)
class Neighbour:
    """One of the nearest sites of every sample of a block."""

    power: Floats
    cell: NDArray[np.int32]
    east: Floats
    north: Floats


def plates(
    shape: tuple[int, int],
    lattice: Integers,
    weight: Floats,
    seeds: NDArray[np.uint32],
    octaves: int,
    place: Integers,
    sites: Sites,
    settings: Floats,
) -> dict[str, Floats]:
    """Return every layer of the plates; arguments as of ``plates_make``."""
    rows, cols = shape
    result = {name: np.empty(shape, dtype=F) for name in LAYERS}
    col = np.arange(cols, dtype=np.int64)[None, :]
    for first in range(0, rows, BLOCK):
        check_cancelled()
        row = np.arange(first, min(first + BLOCK, rows), dtype=np.int64)[:, None]
        noises = [
            fractal(row, col, lattice, weight, seeds, group * octaves, octaves, group == 3)
            for group in range(4)
        ]
        u = place[0] + col * place[1] + row * place[2]
        v = place[3] + col * place[4] + row * place[5]
        u, v = (
            at + (noise * settings[0] * F(16777216)).astype(np.int32).astype(np.int64) * 256
            for at, noise in ((u, noises[0]), (v, noises[1]))
        )
        block = plates_at(u, v, noises[2], noises[3], sites, settings)
        for name in LAYERS:
            result[name][first : first + len(row)] = block[name]
    return result


def fractal(
    row: Integers,
    col: Integers,
    lattice: Integers,
    weight: Floats,
    seeds: NDArray[np.uint32],
    first: int,
    octaves: int,
    ridged: bool,
) -> Floats:
    """Return a sum of octaves of noise, or of its ridges."""
    total = np.zeros((row.shape[0], col.shape[1]), dtype=F)
    for k in range(first, first + octaves):
        at = lattice[k]
        i, x = split(at[0] + col * at[1] + row * at[2])
        j, y = split(at[3] + col * at[4] + row * at[5])
        noise = gradient(i, j, x, y, int(seeds[2 * k]), int(seeds[2 * k + 1]))
        if ridged:
            ridge = F(1) - np.where(noise < F(0), -noise, noise)
            noise = ridge * ridge
        total = total + weight[k] * noise
    return total


def split(position: Integers) -> tuple[NDArray[np.int32], Floats]:
    """Return the lattice index and the fraction in [0, 1) of 32.32 fixed-point positions."""
    fraction = (position & np.int64(0xFFFFFFFF)).astype(U) >> U(8)
    return (position >> np.int64(32)).astype(np.int32), fraction.astype(F) * F(2.0**-24)


def plates_at(
    u: Integers, v: Integers, crust: Floats, ridges: Floats, sites: Sites, settings: Floats
) -> dict[str, Floats]:
    """Return every layer at warped lattice positions."""
    (
        _,  # warp, used by the caller
        size,
        speed,
        narrow,
        wide,
        belt,
        variation,
        shelf,
        slope,
        continent_height,
        ocean_depth,
        ridge_depth,
        mountain_height,
        trench_depth,
        rift_depth,
        hills,
        full_age,
        lift,
        medium,
    ) = settings
    near, border, across = nearest(u, v, sites)
    owner = near[0]

    # How much each of the nearest plates has a say: sharp for belts, wide for crust, and between
    # the two for the age of the ocean floor
    sharp = pair_weights([n.power for n in near], narrow)
    broad = pair_weights([n.power for n in near], medium)
    share = shares([n.power for n in near], wide)
    kind = [sites.table[n.cell, 6] for n in near]
    crustal = np.zeros_like(crust)
    for k in range(NEAREST - 1):
        crustal = crustal + share[k] * kind[k]
    wander = variation * crust
    local = [smooth((kind[k] - F(0.5) + wander) * F(2) + F(0.5)) for k in range(NEAREST - 1)]
    motion = [moving(sites.table, n.cell, n.east, n.north) for n in near[: NEAREST - 1]]

    coast = crustal - F(0.5) + wander
    youth = np.zeros_like(crust)
    mountains = np.zeros_like(crust)
    arcs = np.zeros_like(crust)
    trench = np.zeros_like(crust)
    rift = np.zeros_like(crust)
    convergence = np.zeros_like(crust)
    shear = np.zeros_like(crust)
    uplift = np.zeros_like(crust)
    pair = 0
    for i in range(NEAREST - 2):
        for j in range(i + 1, NEAREST - 1):
            east, north = near[j].east - near[i].east, near[j].north - near[i].north
            apart = np.sqrt(east * east + north * north)
            east, north = east / apart, north / apart
            along = (near[j].power - near[i].power) / (F(2) * apart)
            z = along / belt
            du, dv = motion[i][0] - motion[j][0], motion[i][1] - motion[j][1]
            closing = du * east + dv * north
            sliding = dv * east - du * north
            say = sharp[pair]
            convergence = convergence + say * closing
            shear = shear + say * sliding
            pushed, pull = eased(closing), eased(-closing)
            push: Floats = pushed / (pushed + F(0.8)) * F(1.6)
            opened: Floats = pull / (pull + F(0.8)) * F(1.6)
            both = local[i] * local[j]
            mine = local[i] * (F(1) - local[j])
            other = local[j] * (F(1) - local[i])
            neither = (F(1) - local[i]) * (F(1) - local[j])
            # Of two oceans the older floor goes under
            mine_up = np.where(
                sites.table[near[i].cell, 7] < sites.table[near[j].cell, 7], F(1), F(0)
            )
            z2 = z * z

            # Continents that meet: a broad range on both sides
            wall = F(0.75) * bell(z2, F(1)) + F(0.25) * bell(z2, F(0.16))
            broad_wall = F(0.6) * bell(z2 / (F(0.4) + push), F(1)) + F(0.4) * bell(
                z2 / (F(0.4) + push), F(0.2)
            )
            # Ocean under continent: an arc inland, a trench at sea
            arc_mine, arc_other = bell(square(z - F(1.1)), F(2)), bell(square(z + F(1.1)), F(2))
            deep_mine, deep_other = bell(square(z - F(0.3)), F(14)), bell(square(z + F(0.3)), F(14))
            chain = mine * arc_mine + other * arc_other
            raised: Floats = np.add(both * broad_wall, F(0.8) * chain)
            mountains = mountains + say * push * raised
            trench = trench + say * push * (
                (mine + neither * mine_up) * deep_other
                + (other + neither * (F(1) - mine_up)) * deep_mine
            )
            arcs = arcs + say * push * neither * (mine_up * arc_mine + (F(1) - mine_up) * arc_other)
            # Continents that part: a valley with raised shoulders, in the end a narrow sea
            rift = rift + say * opened * both * (
                F(0.4) * bell(square(z2 - F(1)), F(3)) - bell(z2, F(6))
            )
            coast = coast + say * (
                push * (both * F(0.35) * bell(z2, F(0.4)))
                + push * (mine - other) * F(0.5) * z * bell(z2, F(0.5))
                - opened * both * F(0.3) * bell(z2, F(4))
            )
            lifted = closing * np.where(closing > F(0), F(1), F(0))
            uplift = uplift + say * lifted * (both * wall + F(0.5) * chain)

            # Oceans that part: the floor sinks as the square root of its age
            distance = np.sqrt(along * along + F(0.01) * belt * belt)
            age = distance / (F(0.5) * pull * full_age + F(1e-6))
            sunk = age / np.sqrt(F(1) + age * age)
            youth = youth + broad[pair] * neither * (F(1) - np.sqrt(sunk))
            pair += 1

    floor = ocean_depth - (ocean_depth - ridge_depth) * youth
    land = clamped(coast * F(3))
    shoal = clamped(-coast / shelf)
    drop = smooth((-coast - shelf) / slope)
    upland = smooth(crust * F(1.2) + F(0.35))
    ground = continent_height * land * (F(0.4) + F(1.3) * upland) - F(150) * shoal
    base = ground + drop * (F(150) - floor)
    grain = (F(0.2) + F(0.8) * ridges) * (F(0.6) + F(0.4) * upland)
    height = base + mountain_height * mountains * grain
    height = height + F(0.9) * ocean_depth * arcs * ridges
    height = height - trench_depth * trench * (F(0.25) + F(0.75) * drop)
    height = height + rift_depth * rift
    height = height + hills * (ridges - F(0.45)) * (F(0.1) + upland) * (F(0.25) + F(0.75) * land)

    # The plate under the sample and the boundary that is nearest to it
    closing, sliding = across
    fast = np.where(closing < F(0), -closing, closing)
    swift = np.where(sliding < F(0), -sliding, sliding)
    own, their = sites.table[owner.cell, 6], sites.table[border[1], 6]
    oblique = fast > F(0.36) * swift
    meeting = np.where(own * their > F(0), F(COLLISION), F(SUBDUCTION))
    parting = np.where(own + their > F(0), F(RIFT), F(RIDGE))
    kinds = np.where(oblique, np.where(closing > F(0), meeting, parting), F(TRANSFORM))
    still = (fast + swift == F(0)) | (border[0] > belt) | (speed == F(0))
    return {
        "elevation": height,
        "plate": sites.identity[owner.cell].astype(F),
        "plate_type": own,
        "motion_east": motion[0][0] * speed,
        "motion_north": motion[0][1] * speed,
        "boundary_distance": border[0] * size,
        "convergence": convergence * speed,
        "shear": shear * speed,
        "boundary_class": np.where(still, F(NONE), kinds),
        "uplift": uplift * lift,
    }


def nearest(
    u: Integers, v: Integers, sites: Sites
) -> tuple[list[Neighbour], tuple[Floats, NDArray[np.int32]], tuple[Floats, Floats]]:
    """Return the nearest sites in turn, the nearest boundary, and the motion across it.

    Nearest in the power distance: squared distance less the weight of the site. Of equals the one
    of the lowest row, then column, of the lattice.
    """
    i, x = split(u)
    j, y = split(v)
    cols = sites.shape[1]
    here = (j - np.int32(sites.first[1])) * np.int32(cols) + (i - np.int32(sites.first[0]))
    best = [
        Neighbour(np.full(x.shape, F(1e9)), here, np.zeros_like(x), np.zeros_like(x))
        for _ in range(NEAREST)
    ]
    for dj in range(-REACH, REACH + 1):
        for di in range(-REACH, REACH + 1):
            found = site_at(here, x, y, di, dj, sites)
            for k in range(NEAREST):
                closer = found.power < best[k].power
                best[k], found = chosen(closer, found, best[k]), chosen(closer, best[k], found)
    owner = best[0]
    least = np.full(x.shape, F(1e9))
    beyond = owner
    for dj in range(-FAR_REACH, FAR_REACH + 1):
        for di in range(-FAR_REACH, FAR_REACH + 1):
            found = site_at(here, x, y, di, dj, sites)
            east, north = found.east - owner.east, found.north - owner.north
            apart = np.sqrt(east * east + north * north)
            itself = found.cell == owner.cell
            half = (found.power - owner.power) / np.where(itself, F(1), F(2) * apart)
            closer = ~itself & (half < least)
            least = np.where(closer, half, least)
            beyond = chosen(closer, found, beyond)
    east, north = beyond.east - owner.east, beyond.north - owner.north
    apart = np.sqrt(east * east + north * north)
    east, north = east / apart, north / apart
    mine = moving(sites.table, owner.cell, owner.east, owner.north)
    theirs = moving(sites.table, beyond.cell, beyond.east, beyond.north)
    du, dv = mine[0] - theirs[0], mine[1] - theirs[1]
    least = np.where(least > F(0), least, F(0))
    return best, (least, beyond.cell), (du * east + dv * north, dv * east - du * north)


def site_at(
    here: NDArray[np.int32], x: Floats, y: Floats, di: int, dj: int, sites: Sites
) -> Neighbour:
    """Return the site of a cell beside the sample's own, as seen from the sample."""
    cell = here + np.int32(dj * sites.shape[1] + di)
    east = sites.table[cell, 0] + F(di) - x
    north = sites.table[cell, 1] + F(dj) - y
    return Neighbour(east * east + north * north - sites.table[cell, 2], cell, east, north)


def chosen(where: NDArray[np.bool_], one: Neighbour, other: Neighbour) -> Neighbour:
    """Return one neighbour where a condition holds, and the other elsewhere."""
    return Neighbour(
        np.where(where, one.power, other.power),
        np.where(where, one.cell, other.cell),
        np.where(where, one.east, other.east),
        np.where(where, one.north, other.north),
    )


def moving(
    table: Floats, cell: NDArray[np.int32], east: Floats, north: Floats
) -> tuple[Floats, Floats]:
    """Return the motion of a plate at the sample: v = u + omega x r, r from the site."""
    spin = table[cell, 5]
    return table[cell, 3] + spin * north, table[cell, 4] - spin * east


def shares(power: list[Floats], softness: np.float32) -> list[Floats]:
    """Return weights of the nearest plates that sum to 1 and are smooth across boundaries."""
    end = falling(power[-1] - power[0], softness)
    weight = [falling(p - power[0], softness) - end for p in power[:-1]]
    total = weight[0] + F(1e-20)
    for w in weight[1:]:
        total = total + w
    return [w / total for w in weight]


def pair_weights(power: list[Floats], softness: np.float32) -> list[Floats]:
    """Return weights of the pairs of plates that sum to 1: that these are the nearest two.

    With shares t of each plate, plate i is the nearest and j the second with the chance
    t_i t_j / (1 - t_i), of Plackett and Luce. It is smooth wherever plates change places.
    """
    share = shares(power, softness)
    end = falling(power[-1] - power[1], softness)
    second = [falling(p - power[1], softness) - end for p in power[1:-1]]
    others = second[0] + F(1e-20)
    for s in second[1:]:
        others = others + s
    weights = []
    count = len(share)
    for i in range(count - 1):
        for j in range(i + 1, count):
            back = share[j] * share[i] / (F(1) - share[j] + F(1e-20))
            if i == 0:
                there = share[0] * (second[j - 1] / others)
            else:
                there = share[i] * share[j] / (F(1) - share[i] + F(1e-20))
            chance = there + back
            weights.append(np.where(chance > F(LEAST), chance, F(0)))
    return weights


def falling(excess: Floats, softness: np.float32) -> Floats:
    """Return 2 to the power of minus half the excess over the softness."""
    return faded(excess / (F(-2) * softness))


def faded(exponent: Floats) -> Floats:
    """Return 2 to the power of the exponent, and 0 where that is below the least share."""
    power = exact.exp2(np.where(exponent > F(-24), exponent, F(-24)))
    return np.where(exponent > F(-24), power, F(0))


def eased(closing: Floats) -> Floats:
    """Return the positive part without a crease at 0."""
    positive = np.where(closing > F(1e-4), closing, F(0))
    result: Floats = positive * np.divide(positive, positive + F(0.3))
    return result


def bell(squared: Floats, sharpness: np.float32) -> Floats:
    """Return exp(-sharpness * squared)."""
    return faded(squared * (sharpness * F(-1.44269504)))


def square(value: Floats) -> Floats:
    """Return the value times itself."""
    return value * value


def clamped(value: Floats) -> Floats:
    """Return the value within 0 to 1."""
    value = np.where(value > F(0), value, F(0))
    return np.where(value < F(1), value, F(1))


def smooth(value: Floats) -> Floats:
    """Return a smooth step from 0 at 0 to 1 at 1."""
    t = clamped(value)
    t = np.where(t > F(1e-4), t, F(0))
    return t * t * (F(3) - F(2) * t)
