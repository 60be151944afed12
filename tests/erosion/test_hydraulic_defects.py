"""Every defect that was published for this kind of erosion, on the equations themselves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit_erosion.hydraulic import reference
from terrakit_erosion.hydraulic.plan import turns
from terrakit_erosion.hydraulic.reference import F, Ground, State, Transfer, Window

ROWS, COLS = 16, 24
QUANTUM = 2.0**-16
SPACING = 8.0
SECONDS = 0.25
WINDOW = Window(ROWS, COLS)
SHAPE = (ROWS + 5, COLS + 4)
RATE = SECONDS / (SPACING * QUANTUM)
DRY = np.int32(0)
SOFT = np.float32(1)


def transfer(spread: float = 0.0, *, diagonal: bool = False) -> Transfer:
    rate = RATE / math.sqrt(2.0) if diagonal else RATE
    return Transfer(F(rate), F(1 - 4 * spread), F(spread))


def ground(**changes: Any) -> Ground:
    slant = SPACING * math.sqrt(2.0)
    plain = Ground(
        unit=F(slant * QUANTUM / SECONDS),
        bed_slope=F(QUANTUM / SPACING),
        water_slope=F(QUANTUM / SPACING),
        bed_slant=F(QUANTUM / slant),
        water_slant=F(QUANTUM / slant),
        water_quantum=F(QUANTUM),
        friction=F(1e3),  # so much that the fall of the surface decides
        capacity=F(0.0),
        least_slope=F(0.0),
        threshold=F(0.0),
        erosion_share=F(1.0),
        deposition_share=F(1.0),
    )
    return plain._replace(**changes)


def still(depth: float, load: Any = 0.0, bed: Any = 0.0) -> State:
    """Return a state in metres; the frame goes on as the map ends."""
    fields = [np.broadcast_to(np.asarray(v, dtype=np.float64), SHAPE) for v in (bed, depth, load)]
    return State(*(np.rint(field / QUANTUM).astype(np.int32) for field in fields))


def edges(east: float = 0.0, south: float = 0.0) -> Any:
    axial = np.full(SHAPE, F(east)), np.full(SHAPE, F(south))
    root = math.sqrt(0.5)
    slanted = (
        np.full(SHAPE, F((east + south) * root)),
        np.full(SHAPE, F((south - east) * root)),
    )
    return axial, slanted


def worked(state: State, flows: Any, rules: Ground, step: int = 1) -> State:
    after = State(*(field.copy() for field in state))
    reference.work(
        state, after, state.bed.copy(), flows, DRY, SOFT, turns(step),
        transfer(diagonal=True), rules, 2, 0, WINDOW,
    )  # fmt: skip
    return after


def loads(state: State) -> np.ndarray:
    """Return the load away from the border, m."""
    return WINDOW(state.load)[3:-3, 3:-3] * QUANTUM


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 120.0])
@pytest.mark.parametrize("steepness", [5.0, 30.0])
def test_capacity_is_discharge_times_the_sine_of_the_slope_whatever_the_direction(
    angle: float, steepness: float
) -> None:
    """A slope taken over two cells and divided by one reads 49 degrees for 30."""
    tangent = math.tan(math.radians(steepness))
    east, south = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    row, col = np.indices(SHAPE)
    bed = -tangent * SPACING * (east * col + south * row)
    state = still(2.0, 0.0, bed)
    after = worked(state, edges(0.4 * east, 0.4 * south), ground(capacity=F(0.05 / QUANTUM)))
    expected = 0.05 * 0.4 * math.sin(math.radians(steepness))
    assert loads(after) == pytest.approx(expected, rel=0.02)


def test_a_film_of_water_does_not_erode_like_a_river() -> None:
    row, _ = np.indices(SHAPE)
    bed = -0.5 * SPACING * row
    rules = ground(capacity=F(0.05 / QUANTUM))
    river, brook, film = (
        float(loads(worked(still(2.0, 0.0, bed), edges(0.0, q), rules)).mean())
        for q in (0.4, 0.2, 0.4e-3)
    )
    assert brook == pytest.approx(0.5 * river, rel=0.01)
    assert film < 2e-3 * river


def test_standing_water_that_sloshes_does_not_erode() -> None:
    """What counts is what friction takes, not slope times speed of a wave that passes."""
    row, _ = np.indices(SHAPE)
    rules = ground(capacity=F(1.0 / QUANTUM), friction=F(0.04))
    state = still(50.0, 0.0, 0.1 * (row % 3))
    after = worked(state, edges(0.0, 1.0), rules)
    assert loads(after).max() < 1e-4


def test_what_is_too_much_settles_and_raises_the_ground() -> None:
    """With the published sign the ground sinks and the load runs away."""
    before = still(2.0, 1.0)
    after = worked(before, edges(), ground(deposition_share=F(0.1)))
    inner = WINDOW(after.bed)[3:-3, 3:-3] * QUANTUM
    assert loads(after) == pytest.approx(0.9, rel=1e-3)
    assert inner == pytest.approx(0.1, rel=1e-3)


def test_settling_follows_the_exponential_whatever_the_step() -> None:
    left = []
    for steps in (8, 32):
        share = -math.expm1(-0.8 / steps)
        state = still(4.0, 1.0)
        for step in range(steps):
            state = worked(state, edges(), ground(deposition_share=F(share)), 2 * (step % 16) + 1)
        left.append(float(loads(state).mean()))
    assert left == pytest.approx([math.exp(-0.8)] * 2, rel=1e-3)


def test_a_cell_that_dries_lays_down_all_it_carried() -> None:
    before = still(0.0, 0.5)
    after = worked(before, edges(), ground())
    assert loads(after).max() == 0
    assert WINDOW(after.bed)[3:-3, 3:-3] * QUANTUM == pytest.approx(0.5, abs=1e-9)


def test_no_pit_is_dug_and_no_spike_is_laid() -> None:
    rng = np.random.default_rng(2)
    bed = rng.uniform(0.0, 5.0, SHAPE)
    for rules, load in ((ground(capacity=F(1e3 / QUANTUM)), 0.0), (ground(), 50.0)):
        before = still(0.3, load, bed)
        after = worked(before, edges(0.3, 0.2), rules)
        around = [
            (dr * WINDOW.stride + dc)
            for dr in (-1, 0, 1)
            for dc in (-1, 0, 1)
            if (dr, dc) != (0, 0)
        ]
        now = WINDOW(after.bed).astype(np.int64)
        lowest = np.min([WINDOW(before.bed, o) for o in around], axis=0)
        highest = np.max([WINDOW(before.bed, o) + WINDOW(before.depth, o) for o in around], axis=0)
        was = WINDOW(before.bed)
        assert (now >= np.minimum(was, lowest)).all()
        assert (now <= np.maximum(was, highest)).all()
        assert (now != was).any()


def carried(state: State, flows: Any, steps: int, spread: float = 0.0) -> State:
    """Move load through the edges of the axes on a map that goes round."""
    for step in range(steps):
        reference.wrap(state, WINDOW)
        after = State(*(field.copy() for field in state))
        depth, load, _ = reference.carry(
            state, flows, WINDOW.families[0], DRY, turns(step % 32), transfer(spread), WINDOW
        )
        WINDOW(after.depth)[:] = depth
        WINDOW(after.load)[:] = load
        state = after
    return state


def test_a_square_of_load_moves_with_the_water() -> None:
    load = np.zeros(SHAPE)
    load[7:11, 6:10] = 0.5
    state = still(1.0, load)
    total = int(WINDOW(state.load).sum())
    speed, steps = 1.6, 64
    after = carried(state, edges(speed)[0], steps)
    now = WINDOW(after.load).astype(np.float64)
    assert int(now.sum()) == total
    col = np.arange(COLS)
    expected = 5.5 + speed * steps * SECONDS / SPACING  # of the columns of the map
    assert (now.sum(axis=0) * col).sum() / total == pytest.approx(expected, abs=0.05)
    assert (now.sum(axis=1) * np.arange(ROWS)).sum() / total == pytest.approx(6.5, abs=1e-3)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_diverging_and_converging_flow_keeps_every_grain(sign: float) -> None:
    """Tracing back where the water came from makes 3.09 of 1 in a fan, and 0.17 in a valley."""
    col = np.arange(COLS + 4, dtype=np.float64)
    flow = sign * 0.5 * np.sin(2 * math.pi * (col - 2) / COLS)
    flows = np.broadcast_to(flow, SHAPE).astype(F).copy(), np.zeros(SHAPE, F)
    state = still(3.0, 0.4)
    after = carried(state, flows, 100)
    assert int(WINDOW(after.load).sum()) == int(WINDOW(state.load).sum())
    assert int(WINDOW(after.depth).sum()) == int(WINDOW(state.depth).sum())
    assert WINDOW(after.load).min() >= 0
    assert float(np.ptp(WINDOW(after.load))) * QUANTUM > 0.05


def test_mixing_spreads_load_without_making_any() -> None:
    """Shared out by the number of wet neighbours, one becomes four, and a chessboard stays."""
    single = np.zeros(SHAPE)
    single[9, 12] = 1.0
    after = carried(still(2.0, single), edges()[0], 20, 0.1)
    assert int(WINDOW(after.load).sum()) == round(1 / QUANTUM)
    row, col = np.indices(SHAPE)
    board = carried(still(2.0, 0.5 + 0.4 * ((row + col) % 2)), edges()[0], 40, 0.1)
    assert np.ptp(WINDOW(board.load)) * QUANTUM < 1e-2


def test_cube_root_is_exact_to_the_last_digits() -> None:
    h = np.exp2(np.linspace(-17, 20, 4001)).astype(np.float32)
    exact = h.astype(np.float64) ** (-1 / 3)
    assert np.abs(reference.inverse_cube_root(h) / exact - 1).max() < 1e-6


def test_every_threshold_is_used_once_a_block() -> None:
    for use in range(4):
        values = [float(turns(step)[use]) for step in range(32)]
        assert len(set(values)) == 32
    for family in (0, 1):
        rounds = [float(turns(step).water) for step in range(family, 32, 2)]
        assert np.mean(rounds) == pytest.approx(0.5, abs=0.02)
