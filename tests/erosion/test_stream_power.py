"""Stream power against theory, against serial solvers written here, and against rough input."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Heightfield, Run, routing
from terrakit.compute import choose_device
from terrakit.errors import Cancelled, InputError, ParameterError
from terrakit.ledger import Account
from terrakit.parameters import FromLayer, Schedule
from terrakit_erosion.stream_power import StreamPower
from terrakit_erosion.stream_power.reference import _left as left_of_drop

Heights = NDArray[np.float64]
TURNS: tuple[Callable[[NDArray[Any]], NDArray[Any]], ...] = tuple(
    lambda a, k=k, flip=flip: np.rot90(a[:, ::-1] if flip else a, k).copy()
    for flip in (False, True)
    for k in range(4)
)
NEIGHBOURS = tuple((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))


@pytest.fixture(params=["numpy", None], ids=["numpy", "opencl"])
def device(request: pytest.FixtureRequest) -> str | None:
    if request.param is None and not choose_device().is_opencl:
        pytest.skip("no OpenCL device")
    name: str | None = request.param
    return name


def rough(shape: tuple[int, int] = (49, 49), amplitude: float = 20.0, seed: int = 1) -> Heights:
    return np.random.default_rng(seed).uniform(0, amplitude, shape)


def hilly(samples: int, relief: float = 300.0, seed: int = 2) -> Heights:
    """Return the same hills, a sum of waves of 1 to 8 a side, at any number of samples."""
    random = np.random.default_rng(seed)
    x = np.linspace(0, 1, samples)
    height = np.zeros((samples, samples))
    for _ in range(60):
        wave = random.integers(-8, 9, 2)
        size = max(1.0, math.hypot(*wave))
        phase = 2 * math.pi * (wave[0] * x[:, None] + wave[1] * x[None, :] + random.uniform())
        height += size**-1.8 * np.sin(phase)
    height -= height.min()
    return height / height.max() * relief


def eroded(
    height: Any, spacing: float, device: str | None, sea_level: float | None = None, **settings: Any
) -> tuple[Heightfield, Account]:
    """Return the terrain after stream power, and the account of its rock."""
    terrain = height if isinstance(height, Heightfield) else Heightfield(height, spacing)
    run = Run(5, device, sea_level=sea_level).for_step("stream_power")
    result = StreamPower(**{"outlets": "border", **settings})(terrain, run)
    return result, run.ledger.accounts["rock"]


def border(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    edge = np.ones(shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    return edge


def steepest(height: Heights, spacing: float) -> tuple[NDArray[np.intp], Heights]:
    """Return receiver and distance to it by the textbook, one cell after the other."""
    rows, cols = height.shape
    receiver = np.arange(height.size)
    length = np.ones(height.size)
    for row in range(1, rows - 1):
        for col in range(1, cols - 1):
            best = 0.0
            for i, j in NEIGHBOURS:
                distance = spacing * math.hypot(i, j)
                slope = (height[row, col] - height[row + i, col + j]) / distance
                if slope > best:
                    best = slope
                    receiver[row * cols + col] = (row + i) * cols + col + j
                    length[row * cols + col] = distance
    return receiver, length


def drained(height: Heights, step: float) -> Heights:
    """Return the terrain with its depressions filled so that they slope (Barnes et al. 2014)."""
    level = height.copy()
    random = np.random.default_rng(9)  # no two slopes are equal, so that no order decides
    edge = border(height.shape)
    heap = [(level[row, col], row, col) for row, col in np.argwhere(edge).tolist()]
    heapq.heapify(heap)
    seen = edge.copy()
    while heap:
        water, row, col = heapq.heappop(heap)
        for i, j in NEIGHBOURS:
            r, c = row + i, col + j
            if 0 <= r < level.shape[0] and 0 <= c < level.shape[1] and not seen[r, c]:
                seen[r, c] = True
                level[r, c] = max(level[r, c], water + step * random.uniform(1, 2))
                heapq.heappush(heap, (level[r, c], r, c))
    return level


def serial_step(
    height: Heights, spacing: float, k_dt: float, m: float, n: float, rise: float
) -> Heights:
    """Return the terrain after one implicit step, in float64, solved by bisection."""
    receiver, length = steepest(height, spacing)
    flat = height.ravel()
    order = np.argsort(flat, kind="stable")
    area = np.full(flat.size, spacing**2)
    for cell in order[::-1]:
        if receiver[cell] != cell:
            area[receiver[cell]] += area[cell]
    after = np.where(border(height.shape).ravel(), flat, flat + rise)
    for cell in order:
        below = receiver[cell]
        drop = after[cell] - after[below]
        if below == cell or drop <= 0:
            continue
        low, high = 0.0, drop
        for _ in range(80):
            middle = 0.5 * (low + high)
            if middle + k_dt * area[cell] ** m * (middle / length[cell]) ** n < drop:
                low = middle
            else:
                high = middle
        after[cell] = after[below] + high
    return after.reshape(height.shape)


# --- rivers: theory -------------------------------------------------------------------------


def tree_of(result: Heightfield) -> tuple[NDArray[np.intp], Heights, Heights, Heights]:
    """Return receiver, slope, area and tau-free steps of every cell that is not on the border."""
    height = result.elevation.astype(np.float64)
    receiver, length = steepest(height, result.spacing)
    slope = (height.ravel() - height.ravel()[receiver]) / length
    area = np.full(height.size, result.spacing**2)
    for cell in np.argsort(height.ravel(), kind="stable")[::-1]:
        if receiver[cell] != cell:
            area[receiver[cell]] += area[cell]
    return receiver, slope, area, length


@pytest.mark.parametrize(("m", "n", "erodibility"), [(0.45, 1.0, 2e-5), (0.6, 1.5, 1e-4)])
def test_a_steady_range_has_the_slopes_and_heights_of_theory(
    device: str | None, m: float, n: float, erodibility: float
) -> None:
    uplift = 1e-3
    settings = {"duration": 5e6, "time_step": 5e4, "uplift_rate": uplift, "diffusivity": 0.0}
    settings |= {"erodibility": erodibility, "area_exponent": m, "slope_exponent": n}
    result, account = eroded(rough(), 100.0, device, routing="d8", **settings)

    # S = (U/K)^(1/n) A^(-m/n)
    receiver, slope, area, length = tree_of(result)
    inner = ~border(result.shape).ravel()
    expected = (uplift / erodibility) ** (1 / n) * area ** (-m / n)
    error = np.abs(slope / expected - 1)[inner]
    assert np.median(error) < 1e-3
    assert np.quantile(error, 0.95) < 0.02

    # The concavity of slope and area is m/n, and so is that which makes chi plots straight
    fit = np.polyfit(np.log(area[inner]), np.log(slope[inner]), 1)[0]
    assert -fit == pytest.approx(m / n, abs=0.005)
    order = np.argsort(result.elevation.ravel(), kind="stable")
    height = result.elevation.ravel() - result.elevation.ravel()[follow(receiver)]
    candidates = np.arange(0.2, 0.7, 0.01)
    straight = [
        np.corrcoef(chi(order, receiver, length, area**-c)[inner], height[inner])[0, 1]
        for c in candidates
    ]
    assert candidates[int(np.argmax(straight))] == pytest.approx(m / n, abs=0.015)

    # z = U tau, where tau is the time that a wave takes from the outlet
    tau = chi(order, receiver, length, (uplift / erodibility) ** (1 / n) * area ** (-m / n))
    assert np.median(np.abs(height[inner] / tau[inner] - 1)) < 1e-3

    # What rises is what leaves
    assert account.came["uplift"] == pytest.approx(sum(account.left.values()), rel=0.2)


def follow(receiver: NDArray[np.intp]) -> NDArray[np.intp]:
    while True:
        further = receiver[receiver]
        if np.array_equal(further, receiver):
            return further
        receiver = further


def chi(
    order: NDArray[np.intp], receiver: NDArray[np.intp], length: Heights, weight: Heights
) -> Heights:
    """Return the sum of length times weight on the way down."""
    total = np.zeros(order.size)
    for cell in order:
        if receiver[cell] != cell:
            total[cell] = total[receiver[cell]] + length[cell] * weight[cell]
    return total


def test_a_knickpoint_travels_at_the_speed_of_theory(device: str | None) -> None:
    """A step of the outlet moves up a trough of constant area at K A^m."""
    cols, spacing, speed = 201, 100.0, 2e-3
    height = np.full((3, cols), 5000.0)
    height[1] = 100.0 + 0.001 * np.arange(cols)  # a canal whose water comes from its far end
    height[1, 0] = 0.0
    result, _ = eroded(
        height,
        spacing,
        device,
        **{"duration": 5e6, "time_step": 1e4, "uplift_rate": 0.0, "diffusivity": 0.0},
        **{"erodibility": speed, "area_exponent": 1e-6, "outlets": "lowest"},
        **{"outlet_spacing": 1e6, "routing": "d8"},
    )
    half = int(np.argmax(result.elevation[1] > 50.0))
    assert half * spacing == pytest.approx(speed * 5e6, rel=0.03)


# --- rivers: one step against others --------------------------------------------------------


@pytest.mark.parametrize("n", [0.5, 1.0, 2.0, 3.5])
def test_one_step_is_that_of_a_serial_solver(device: str | None, n: float) -> None:
    height = drained(rough((25, 31), 100.0), 0.01).astype(np.float32).astype(np.float64)
    k_dt = 2.0
    expected = serial_step(height, 50.0, k_dt, 0.4, n, 2.0)
    result, _ = eroded(
        height,
        50.0,
        device,
        **{"duration": 1000.0, "time_step": 1000.0, "uplift_rate": 2e-3, "diffusivity": 0.0},
        **{"erodibility": k_dt / 1000, "area_exponent": 0.4, "slope_exponent": n},
        routing="d8",
    )
    cut = float((height + 2.0 - expected)[1:-1, 1:-1].max())
    assert cut > 5.0
    assert np.abs(result.elevation - expected).max() < 2e-5 * cut + 0.01


@pytest.mark.parametrize("n", [1.0, 1.6])
def test_one_step_is_that_of_fastscapelib(n: float) -> None:
    fastscapelib = pytest.importorskip("fastscapelib")
    height = drained(rough((40, 50), 100.0), 0.01).astype(np.float32).astype(np.float64)
    grid = fastscapelib.RasterGrid([40, 50], [50.0, 50.0], fastscapelib.NodeStatus.FIXED_VALUE)
    graph = fastscapelib.FlowGraph(grid, [fastscapelib.SingleFlowRouter()])
    graph.update_routes(height)
    eroder = fastscapelib.SPLEroder(graph, 1e-3, 0.4, n, 1e-9)
    cut = eroder.erode(height, graph.accumulate(1.0), 1000.0)
    result, _ = eroded(
        height,
        50.0,
        "numpy",
        **{"duration": 1000.0, "time_step": 1000.0, "uplift_rate": 0.0, "diffusivity": 0.0},
        **{"erodibility": 1e-3, "area_exponent": 0.4, "slope_exponent": n, "routing": "d8"},
    )
    assert cut.max() > 5.0
    assert np.abs(result.elevation - (height - cut)).max() < 1e-3


@pytest.mark.parametrize("n", [0.3, 0.7, 1.0, 1.5, 2.5, 4.0])
def test_the_height_left_of_a_drop_solves_its_equation(n: float) -> None:
    """Over thirty orders of magnitude of strength, Newton's method ends within two quanta."""
    random = np.random.default_rng(1)
    drop = np.rint(10 ** random.uniform(0.4, 6.0, 4000)).astype(np.int32)
    strength = (10 ** random.uniform(-10, 20, 4000)).astype(np.float32)
    length, quantum = np.full(4000, 20.0, np.float32), 2.0**-14
    low, high = np.zeros(4000), drop * quantum / 20.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        above = middle + strength.astype(np.float64) / 20.0 * middle**n > drop * quantum / 20.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    left = left_of_drop(drop, strength, length, n, quantum)
    # int() of what is cut leaves up to one quantum more
    assert np.abs(left - high * 20.0 / quantum).max() < 2.0
    assert (left <= drop).all()
    assert (left >= 0).all()


@pytest.mark.parametrize("n", [0.5, 1.0, 3.0])
def test_any_time_step_is_stable(device: str | None, n: float) -> None:
    height = rough((33, 33), 500.0)
    for erodibility, step in ((1.0, 1e8), (1.0, 1e9), (1e-30, 1e9)):
        result, account = eroded(
            height,
            30.0,
            device,
            **{"duration": step, "time_step": step, "uplift_rate": 0.0, "diffusivity": 0.0},
            **{"erodibility": erodibility, "slope_exponent": n},
        )
        assert np.isfinite(result.elevation).all()
        assert result.elevation.max() <= height.max() + 1e-3
        assert result.elevation.min() >= height.min() - 1e-3
        assert_closed(account)
    # Nothing was left of the mountains at 1e9, and nothing was touched by 1e-30
    np.testing.assert_array_equal(result.elevation, height.astype(np.float32))


def test_water_runs_downhill_after_a_step_and_outlets_end_it(device: str | None) -> None:
    height = drained(rough((33, 33), 500.0), 0.01)
    result, _ = eroded(
        height,
        30.0,
        device,
        **{"duration": 1e8, "time_step": 1e8, "uplift_rate": 0.0, "diffusivity": 0.0},
        **{"erodibility": 1.0, "routing": "d8"},
    )
    receiver, _ = steepest(height, 30.0)
    after = result.elevation.ravel().astype(np.float64)
    inner = ~border(result.shape).ravel()
    assert (after[inner] > after[receiver[inner]] - 1e-4).all()


# --- hillslopes -----------------------------------------------------------------------------


def test_a_bump_spreads_like_heat(device: str | None) -> None:
    spacing, diffusivity, variance = 10.0, 0.05, 60.0**2
    x = (np.arange(81) - 40) * spacing
    square = x[:, None] ** 2 + x[None, :] ** 2
    height = 50 * np.exp(-square / (2 * variance))
    result, account = eroded(
        height,
        spacing,
        device,
        **{"duration": 4e4, "time_step": 1e4, "uplift_rate": 0.0, "erodibility": 0.0},
        diffusivity=diffusivity,
    )
    after = result.elevation.astype(np.float64)
    grown = variance + 2 * diffusivity * 4e4
    exact = 50 * variance / grown * np.exp(-square / (2 * grown))
    assert np.abs(after - exact).max() < 0.01 * exact.max()
    for axis in (x[:, None] ** 2, x[None, :] ** 2, (x[:, None] + x[None, :]) ** 2 / 2):
        moment = float((after * axis).sum() / after.sum() - (height * axis).sum() / height.sum())
        assert moment == pytest.approx(2 * diffusivity * 4e4, rel=0.01)
    assert sum(account.left.values()) < 1e-3 * account.start
    assert_closed(account)


def strip(height: float, cols: int) -> Heights:
    """Return a strip between two held columns, whose long sides let nothing pass."""
    ground = np.full((5, cols), height)
    ground[:, [0, -1]] = -1e-3
    return ground


@pytest.mark.parametrize("steep", [0.3, 0.75])
def test_a_ridge_gets_the_steady_profile_of_nonlinear_creep(
    device: str | None, steep: float
) -> None:
    """Roering et al. 1999; ``steep`` is the slope at the foot relative to the critical one."""
    spacing, cols, diffusivity, critical = 20.0, 21, 0.05, math.tan(math.radians(40))
    half = 0.5 * (cols - 1) * spacing
    uplift = diffusivity * steep * critical / (1 - steep**2) / half
    result, _ = eroded(
        strip(0.0, cols),
        spacing,
        device,
        0.0,
        **{"duration": 1.5e6, "time_step": 1e4, "uplift_rate": uplift, "erodibility": 0.0},
        **{"diffusivity": diffusivity, "critical_slope": 40.0, "outlets": "lowest"},
        outlet_spacing=1e9,
    )
    x = (np.arange(cols) - (cols - 1) / 2) * spacing
    root = np.sqrt(1 + (2 * uplift * x / (diffusivity * critical)) ** 2)
    profile = diffusivity * critical**2 / (2 * uplift) * (np.log(0.5 * (root + 1)) - root + 1)
    profile -= profile[0]
    got = result.elevation.astype(np.float64)
    assert np.ptp(got[:, 1:-1], axis=0).max() < 0.01 * profile.max()
    assert np.abs(got[2] - profile).max() < (0.005 if steep < 0.5 else 0.03) * profile.max()


def test_nonlinear_creep_knows_no_direction(device: str | None) -> None:
    """A bowl of slopes up to the critical one changes alike all around (m = 4 harmonic)."""
    row, col = np.indices((65, 65)) - 32.0
    away, angle = np.hypot(row, col), np.arctan2(row, col)
    bowl = 0.7 * 10.0 * away**2 / 64  # slope 0.44 at a radius of 20
    settings = {"duration": 2e3, "time_step": 1e3, "uplift_rate": 0.0, "erodibility": 0.0}
    result, _ = eroded(bowl, 10.0, device, diffusivity=0.05, critical_slope=40.0, **settings)
    change = result.elevation - bowl
    ring = np.abs(away - 20.0) < 2.0
    uneven = abs((change * np.exp(4j * angle))[ring].mean() / change[ring].mean())
    assert uneven < 0.02


def test_slopes_beyond_the_critical_one_do_not_ring(device: str | None) -> None:
    uplift, cols = 2e-3, 21
    result, _ = eroded(
        strip(0.0, cols),
        20.0,
        device,
        0.0,
        **{"duration": 1e6, "time_step": 1e4, "uplift_rate": uplift, "erodibility": 0.0},
        **{"diffusivity": 0.05, "critical_slope": 30.0, "outlets": "lowest"},
        outlet_spacing=1e9,
    )
    fall = np.diff(result.elevation[2].astype(np.float64))
    assert (fall[:10] > 0).all()
    assert (np.diff(fall[:10]) < 0).all()  # convex all the way, steepest at the foot


def test_rivers_and_slopes_make_no_new_highs_or_lows(device: str | None) -> None:
    height = rough((40, 33), 800.0)
    result, account = eroded(
        height,
        25.0,
        device,
        **{"duration": 1e5, "uplift_rate": 0.0, "diffusivity": 0.05, "critical_slope": 35.0},
    )
    assert result.elevation.max() <= height.max() + 1e-3
    assert result.elevation.min() >= height.min() - 1e-3
    assert_closed(account)


# --- the books ------------------------------------------------------------------------------


def assert_closed(account: Account) -> None:
    assert account.end is not None
    scale = max(abs(account.start), abs(account.end), account.moved, *account.came.values())
    assert abs(account.residual) <= 1e-12 * scale


def test_the_ledger_is_what_the_heights_say(device: str | None) -> None:
    height = hilly(65)
    height[20:30, 5:25] = -50.0
    terrain = Heightfield(height, 30.0)
    settings = {"duration": 4e5, "time_step": 2e4, "uplift_rate": 1e-3, "outlets": "lowest"}
    result, account = eroded(terrain, 0, device, 10.0, **settings)
    area = 900.0
    before, after = (t.elevation.astype(np.float64) for t in (terrain, result))
    assert account.start == pytest.approx(before.sum() * area, rel=1e-7)
    assert account.end == pytest.approx(after.sum() * area, rel=1e-7)
    held = before == after  # all others rise
    assert account.came["uplift"] == pytest.approx(np.sum(~held) * 400.0 * area, rel=1e-4)
    assert account.left["sea"] > 0
    gone = np.where(held, 0, before + 400.0 - after).sum() * area
    assert sum(account.left.values()) == pytest.approx(gone, rel=1e-4)
    assert account.moved >= 0.9999 * gone
    assert_closed(account)


def test_what_leaves_a_side_is_what_its_catchments_lost(device: str | None) -> None:
    height = drained(rough((30, 41), 200.0), 0.01).astype(np.float32).astype(np.float64)
    settings = {"duration": 1e4, "time_step": 1e4, "uplift_rate": 1e-3, "diffusivity": 0.0}
    result, account = eroded(height, 50.0, device, routing="d8", erodibility=1e-4, **settings)
    outlet_of = follow(steepest(height, 50.0)[0])
    row, col = np.divmod(outlet_of.reshape(height.shape), 41)
    side = np.full(height.shape, "inside", dtype="<U12")
    side[col == 40], side[col == 0] = "border east", "border west"
    side[row == 29], side[row == 0] = "border south", "border north"
    lost = np.where(border(height.shape), 0, height + 10.0 - result.elevation) * 2500.0
    assert set(account.left) == {f"border {s}" for s in ("north", "south", "west", "east")}
    for name, volume in account.left.items():
        assert volume == pytest.approx(float(lost[side == name].sum()), rel=1e-4)


def test_what_rises_is_booked_to_the_quantum_however_many_steps(device: str | None) -> None:
    """An uplift of less than half a quantum a step is not lost to rounding."""
    height = np.zeros((9, 9))
    settings = {"duration": 1000.0, "time_step": 2.0, "erodibility": 0.0, "diffusivity": 0.0}
    result, account = eroded(height, 100.0, device, uplift_rate=4e-5, **settings)
    np.testing.assert_allclose(result.elevation[1:-1, 1:-1], 0.04, atol=2e-4)
    assert account.came["uplift"] == pytest.approx(49 * 1e4 * 0.04, rel=5e-3)


# --- where water leaves ---------------------------------------------------------------------


def test_a_fixed_border_keeps_its_bits(device: str | None) -> None:
    height = rough((33, 21))
    result, _ = eroded(height, 30.0, device, duration=1e5)
    edge = border(height.shape)
    np.testing.assert_array_equal(result.elevation[edge], height.astype(np.float32)[edge])
    assert (result.elevation[~edge] != height.astype(np.float32)[~edge]).all()


@pytest.mark.parametrize("outlet_spacing", [0.0, 300.0, 1000.0, 1e9])
def test_rivers_leave_at_the_lowest_points_at_least_so_far_apart(
    device: str | None, outlet_spacing: float
) -> None:
    height = rough((41, 33)).astype(np.float32)
    settings = {"duration": 5e4, "time_step": 1e4, "outlet_spacing": outlet_spacing}
    result, _ = eroded(height, 50.0, device, outlets="lowest", **settings)
    index = np.indices(height.shape)
    around = np.concatenate(
        (index[:, 0, :-1], index[:, :-1, -1], index[:, -1, :0:-1], index[:, :0:-1, 0]), axis=1
    )
    along, after = height[tuple(around)], result.elevation[tuple(around)]
    held = np.flatnonzero(along == after)
    gaps = np.diff(np.append(held, held[0] + along.size)) * 50.0
    assert held.size >= 1
    assert along.argmin() in held
    if held.size > 1:
        assert gaps.min() > outlet_spacing
    if outlet_spacing == 1e9:
        assert held.size == 1
    elif outlet_spacing:
        assert held.size > 1 or outlet_spacing == 1000.0


def test_the_sea_is_left_alone_and_takes_what_comes(device: str | None) -> None:
    height = hilly(49) - 120.0
    settings = {"duration": 3e5, "uplift_rate": 1e-3, "outlets": "lowest"}
    result, account = eroded(height, 50.0, device, 0.0, **settings)
    sea = height.astype(np.float32) < 0
    assert 0.1 < sea.mean() < 0.9
    np.testing.assert_array_equal(result.elevation[sea], height.astype(np.float32)[sea])
    assert (result.elevation[~sea] > -1e-3).all()
    assert account.left["sea"] > 0
    assert_closed(account)


def test_a_drowned_terrain_stays_as_it_is(device: str | None) -> None:
    height = rough((9, 12))
    result, account = eroded(height, 50.0, device, 1e4, duration=1e5)
    np.testing.assert_array_equal(result.elevation, height.astype(np.float32))
    assert account.left == {}


# --- grid, time and space -------------------------------------------------------------------


@pytest.mark.parametrize("where", ["lowest", "border"])
def test_turned_and_mirrored_terrain_gives_the_same_turned_bytes(
    device: str | None, where: str
) -> None:
    height = rough((33, 33), 300.0).astype(np.float32)
    settings = {"duration": 2e5, "time_step": 2e4, "critical_slope": 40.0, "outlets": where}
    plain, _ = eroded(height, 30.0, device, routing="d8", **settings)
    for turn in TURNS[1:]:
        turned, _ = eroded(turn(height), 30.0, device, routing="d8", **settings)
        for name in plain:
            np.testing.assert_array_equal(turned.layer(name), turn(plain.layer(name)), name)


def test_both_backends_give_the_same_bytes() -> None:
    if not choose_device().is_opencl:
        pytest.skip("no OpenCL device")
    height = hilly(49)
    strange = rough((37, 52), 900.0)
    for ground, settings in (
        (height, {"critical_slope": 35.0, "outlets": "lowest"}),
        (height, {"slope_exponent": 0.4, "uplift_rate": 0.5}),
        (strange, {"slope_exponent": 3.7, "routing": "d8"}),
        (strange, {"erodibility": 1.0, "area_exponent": 2.0, "slope_exponent": 1.7}),
        (strange, {"uplift_rate": Schedule(at=[0.0, 1.0], value=[2e-3, 0.0])}),
        (strange, {"erodibility": FromLayer(layer="elevation", low=0.0, high=1e-4, at=[0, 900])}),
    ):
        both = [
            eroded(ground, 40.0, device, duration=2e5, **settings)[0] for device in ("numpy", None)
        ]
        for name in both[0]:
            np.testing.assert_array_equal(both[0].layer(name), both[1].layer(name), name)


def test_rho8_follows_the_slope_of_a_plane_in_the_mean(device: str | None) -> None:
    """Where the fall is at 14 degrees from the axis, d8 never turns and rho8 does in the mean."""
    row, col = np.indices((65, 65))
    height = (1000.0 - 4.0 * row - 1.0 * col).astype(np.float32)
    settings = {"duration": 1.0, "time_step": 1.0, "uplift_rate": 0.0, "erodibility": 0.0}
    settings |= {"diffusivity": 0.0, "outlets": "border"}
    grid, _ = eroded(height, 10.0, device, routing="d8", **settings)
    assert np.unique(grid.layer("drainage_area")[40, 1:-1]).size == 1

    counts = np.rint(height * 2**14).astype(np.int32)
    outlet = border(height.shape).astype(np.uint8)
    receiver = routing.route(counts, outlet, method="rho8", seed=(1, 2)).receiver
    inner = ~border(height.shape)
    step = (receiver - np.arange(height.size).reshape(height.shape))[inner]
    assert set(np.unique(step)) == {65, 66}
    assert (step == 66).mean() == pytest.approx(0.25, abs=0.02)


def test_rho8_makes_no_star_of_a_cone(device: str | None) -> None:
    """Rivers on a cone leave in all directions, not along eight rays."""
    row, col = np.indices((65, 65)) - 32.0
    cone = 500.0 - 8.0 * np.hypot(row, col)
    angle = np.arctan2(row, col)
    ring = np.abs(np.hypot(row, col) - 24.0) < 2.0
    settings = {"duration": 2e4, "time_step": 1e4, "uplift_rate": 0.0, "diffusivity": 0.0}
    star = {}
    for method in ("d8", "rho8"):
        result, _ = eroded(cone, 20.0, device, routing=method, erodibility=1e-5, **settings)
        cut = cone - result.elevation
        star[method] = float(abs((cut * np.exp(8j * angle))[ring].mean() / cut[ring].mean()))
    assert star["rho8"] < 0.6 * star["d8"]


def test_half_the_time_step_changes_little(device: str | None) -> None:
    settings = {"duration": 1e6, "uplift_rate": 1e-3, "erodibility": 2e-5, "diffusivity": 0.02}
    means = []
    for step in (2e4, 1e4):
        result, _ = eroded(hilly(65), 100.0, device, time_step=step, **settings)
        means.append(float(result.elevation.mean()))
    assert means[0] == pytest.approx(means[1], rel=0.05)


def test_twice_the_samples_keep_relief_and_concavity() -> None:
    settings = {"duration": 2e6, "time_step": 2e4, "uplift_rate": 1e-3, "erodibility": 2e-5}
    relief, theta = [], []
    for samples, spacing in ((49, 200.0), (97, 100.0)):
        result, _ = eroded(hilly(samples), spacing, None, diffusivity=0.0, **settings)
        height = result.elevation.astype(np.float64)
        relief.append(float(np.quantile(height, 0.98)))
        _, slope, area, _ = tree_of(result)
        chosen = ~border(height.shape).ravel() & (area > 5e5) & (slope > 1e-4)
        theta.append(-float(np.polyfit(np.log(area[chosen]), np.log(slope[chosen]), 1)[0]))
    assert relief[0] == pytest.approx(relief[1], rel=0.18)
    assert theta[0] == pytest.approx(theta[1], abs=0.03)


# --- layers and schedules -------------------------------------------------------------------


@pytest.mark.parametrize("name", ["uplift_rate", "erodibility"])
def test_a_constant_layer_is_the_number_bit_for_bit(device: str | None, name: str) -> None:
    value = float(np.float32({"uplift_rate": 1.1e-3, "erodibility": 3.3e-5}[name]))
    terrain = Heightfield(rough((21, 33)), 30.0)
    layered = terrain.with_layers(mask_rock=np.full(terrain.shape, np.float32(value)))
    settings = {"duration": 1e5, "time_step": 7e3}
    number, _ = eroded(terrain, 0, device, **{name: value}, **settings)
    layer, _ = eroded(layered, 0, device, **{name: "mask_rock"}, **settings)
    flat, _ = eroded(terrain, 0, device, **{name: Schedule(at=[0.0], value=[value])}, **settings)
    for other in (layer, flat):
        for layer_name in number:
            np.testing.assert_array_equal(number.layer(layer_name), other.layer(layer_name))


def test_hard_rock_stands_and_the_east_rises(device: str | None) -> None:
    terrain = Heightfield(rough((33, 49)), 50.0)
    east = np.linspace(0, 1, 49, dtype=np.float32)[None, :].repeat(33, axis=0)
    terrain = terrain.with_layers(mask_east=east)
    settings = {"duration": 5e5, "time_step": 2e4}
    rising, _ = eroded(
        terrain,
        0,
        device,
        uplift_rate=FromLayer(layer="mask_east", low=0.0, high=2e-3),
        **settings,
    )
    assert rising.elevation[:, 30:48].mean() > 3 * rising.elevation[:, 1:19].mean()
    hard, account = eroded(
        terrain,
        0,
        device,
        erodibility=FromLayer(layer="mask_east", low=1e-4, high=0.0),
        **settings,
    )
    assert hard.elevation[:, 40:48].mean() > 3 * hard.elevation[:, 1:9].mean()
    assert_closed(account)


def test_erodibility_may_follow_the_elevation(device: str | None) -> None:
    height = hilly(33, 1000.0)
    soft = FromLayer(layer="elevation", at=[400.0, 401.0], low=0.0, high=1e-4)
    result, _ = eroded(
        height,
        30.0,
        device,
        **{"duration": 2e4, "time_step": 1e4, "uplift_rate": 0.0, "diffusivity": 0.0},
        erodibility=soft,
    )
    low = height < 399.9
    np.testing.assert_array_equal(result.elevation[low], height.astype(np.float32)[low])
    assert (result.elevation[height > 402.0] < height[height > 402.0]).mean() > 0.5


def test_a_schedule_is_followed_through_the_run(device: str | None) -> None:
    """What a ramp lifts is its integral; what cuts last shows most."""
    settings = {"duration": 1e5, "time_step": 1e4, "diffusivity": 0.0}
    ramp = Schedule(at=[0.0, 1.0], value=[0.0, 2e-3])
    lifted, account = eroded(
        np.zeros((9, 9)), 50.0, device, uplift_rate=ramp, erodibility=0.0, **settings
    )
    np.testing.assert_allclose(lifted.elevation[1:-1, 1:-1], 100.0, atol=1e-3)
    assert account.came["uplift"] == pytest.approx(49 * 2500 * 100.0, rel=1e-5)

    early, late = (
        Schedule(at=[0.0, 0.45, 0.55, 1.0], value=v)
        for v in ([1e-4, 1e-4, 0.0, 0.0], [0.0, 0.0, 1e-4, 1e-4])
    )
    first, last = (
        eroded(rough((21, 21)), 50.0, device, erodibility=k, uplift_rate=1e-3, **settings)[0]
        for k in (early, late)
    )
    assert first.elevation.mean() > 1.2 * last.elevation.mean()


# --- begin and end --------------------------------------------------------------------------


def test_no_time_changes_nothing(device: str | None) -> None:
    terrain = Heightfield(rough(), 30.0)
    result, account = eroded(terrain, 0, device, duration=0.0)
    assert list(result) == ["elevation"]
    assert result.elevation.tobytes() == terrain.elevation.tobytes()
    assert account.residual == 0
    assert account.came == {"uplift": 0.0}


@pytest.mark.parametrize("when", [0, 1, 3])
def test_finish_now_keeps_a_valid_terrain_and_closed_books(device: str | None, when: int) -> None:
    terrain = Heightfield(rough((33, 33), 300.0), 30.0)
    run = Run(5, device).for_step("stream_power")
    run.on_progress = lambda p: run.finish_now() if p.done == when else None
    result = StreamPower(duration=1e6, time_step=1e4, outlets="border")(terrain, run)
    account = run.ledger.accounts["rock"]
    assert np.isfinite(result.elevation).all()
    assert_closed(account)
    inner = 31 * 31 * 900.0
    # The step at whose report it was asked is still done
    assert account.came["uplift"] == pytest.approx(inner * (when + 1) * 5.0, rel=1e-4)
    assert np.isfinite(result.layer("drainage_area")).all()


def test_cancel_leaves_nothing(device: str | None) -> None:
    terrain = Heightfield(rough((33, 33)), 30.0)
    run = Run(5, device).for_step("stream_power")
    run.on_progress = lambda p: run.cancel() if p.done == 2 else None
    with pytest.raises(Cancelled):
        StreamPower(duration=1e6, time_step=1e4)(terrain, run)
    assert run.ledger.accounts == {}


def test_a_run_that_would_not_end_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"time_step = 0.1: 10000000 steps .* raise time_step"):
        eroded(rough(), 30.0, "numpy", duration=1e6, time_step=0.1)
    with pytest.raises(ParameterError, match=r"diffusivity = 10000: creep takes \d+ sweeps"):
        eroded(rough(), 30.0, "numpy", duration=1e6, diffusivity=1e4)


def test_an_uplift_out_of_this_world_is_refused() -> None:
    with pytest.raises(ParameterError, match="uplift_rate: 1 m/yr over 1e"):
        eroded(rough(), 0.1, "numpy", duration=1e10, time_step=1e9, uplift_rate=1.0)
    with pytest.raises(InputError, match=r"elevation: .* m of relief .* check the spacing"):
        eroded(rough((9, 9), 1e5), 1e-6, "numpy", duration=1e3)


# --- awkward terrain ------------------------------------------------------------------------


def awkward() -> dict[str, tuple[Heights, float]]:
    row, col = np.indices((24, 31)).astype(np.float64)
    spike = np.zeros((24, 31))
    spike[10, 10] = 5000.0
    comb = np.where(col % 2 == 0, 0.0, 2000.0)
    return {
        "spike": (spike, 10.0),
        "pit": (-spike, 10.0),
        "cliff": (np.where(col < 15, 0.0, 3000.0), 5.0),
        "comb": (comb, 5.0),
        "checkerboard": ((row + col) % 2 * 100.0, 10.0),
        "flat": (np.zeros((24, 31)), 10.0),
        "flat, high": (np.full((24, 31), 8848.0), 10.0),
        "deep": (rough((24, 31), 1.0) - 11000.0, 1.0),
        "far from zero": (rough((24, 31), 1.0) + 1e6, 1.0),
        "1 cm on 5000 km": (rough((24, 31), 0.01), 200000.0),
        "mountains on a nail": (rough((24, 31), 1e-3), 1e-4),
        "a planet": (rough((24, 31), 1e4), 1e8),
        "3x3": (rough((3, 3)), 10.0),
        "3x40": (rough((3, 40)), 10.0),
        "40x3": (rough((40, 3)), 10.0),
    }


def test_a_tile_may_lie_anywhere(device: str | None) -> None:
    for origin in ((1e18, -1e18), (-1e300, 1e300)):
        terrain = Heightfield(rough((9, 9)), 1e-2, origin)
        result, _ = eroded(terrain, 0, device, duration=10.0, diffusivity=0.0)
        assert np.isfinite(result.elevation).all()


@pytest.mark.parametrize("name", awkward())
def test_awkward_terrain_stays_terrain(device: str | None, name: str) -> None:
    height, spacing = awkward()[name]
    for settings in (
        {"outlets": "lowest", "critical_slope": 40.0, "diffusivity": min(0.02, spacing**2 * 1e-4)},
        {"slope_exponent": 2.3, "diffusivity": 0.0, "erodibility": 1e-2},
        {"slope_exponent": 0.3, "diffusivity": 0.0, "area_exponent": 2.0, "erodibility": 1.0},
    ):
        rise = 1e-3 * min(1.0, spacing)
        result, account = eroded(
            height,
            spacing,
            device,
            **{"duration": 5e4, "time_step": 1e4, "uplift_rate": rise, **settings},
        )
        low, high = float(height.min()), float(height.max())
        slack = 1e-6 * (abs(low) + abs(high)) + 1e-5 * spacing
        assert result.elevation.min() >= low - slack
        assert result.elevation.max() <= high + rise * 5e4 + slack
        assert (result.layer("erosion") >= 0).all()
        assert result.layer("drainage_area").min() >= 0.999 * spacing**2
        assert_closed(account)
