"""Water always finds the lowest way out, and finds the same one everywhere."""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import routing
from terrakit.compute import Device, choose_device
from terrakit.errors import ParameterError

Grid = NDArray[np.int32]
SEED = (7, 11)
ORIGIN = (-40, 1000)


@pytest.fixture(scope="module")
def device() -> Device:
    info = choose_device()
    if not info.is_opencl:
        pytest.skip("no OpenCL device")
    return Device(info)


# --- terrains -------------------------------------------------------------------------------


def hills(rows: int, cols: int, quantum: float = 1e-6) -> Grid:
    """Return a sum of smoothed random grids, finer and lower ones on top of each other."""
    random = np.random.default_rng(3)
    height = np.zeros((rows, cols))
    for octave in range(1, 7):
        knots = 2**octave
        values = random.standard_normal((knots + 2, knots + 2))
        row, col = (np.linspace(0, knots, n, endpoint=False) for n in (rows, cols))
        i, j = row.astype(int), col.astype(int)
        u, v = row - i, col - j
        u, v = (u * u * (3 - 2 * u))[:, np.newaxis], v * v * (3 - 2 * v)
        north = values[np.ix_(i, j)] * (1 - v) + values[np.ix_(i, j + 1)] * v
        south = values[np.ix_(i + 1, j)] * (1 - v) + values[np.ix_(i + 1, j + 1)] * v
        height += (north * (1 - u) + south * u) * 0.6**octave
    return np.round(height / quantum).astype(np.int32)


def noise(rows: int, cols: int, largest: int) -> Grid:
    random = np.random.default_rng(rows * 1000 + cols)
    return random.integers(-largest, largest, (rows, cols), endpoint=True).astype(np.int32)


def border(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    outlet = np.zeros(shape, np.uint8)
    outlet[[0, -1]] = outlet[:, [0, -1]] = 1
    return outlet


def corner(shape: tuple[int, ...]) -> NDArray[np.uint8]:
    outlet = np.zeros(shape, np.uint8)
    outlet[-1, 0] = 1
    return outlet


TERRAINS: dict[str, Grid] = {
    "noise": noise(64, 50, 2**30 - 1),
    "rough integers": noise(41, 60, 3),
    "flat": np.full((33, 40), 5, np.int32),
    "hills": hills(97, 130),
    "hills in few steps": hills(90, 70, 0.15),
    "checkerboard": (np.indices((20, 21)).sum(0) % 2).astype(np.int32),
    "one row": noise(1, 300, 9),
    "one column": noise(300, 1, 9),
    "two columns": noise(50, 2, 4),
    "1x1": noise(1, 1, 4),
    "2x2": noise(2, 2, 4),
    "3x3": noise(3, 3, 4),
    "17x5": noise(17, 5, 4),
}


def cases() -> list[Any]:
    return [
        pytest.param(height, outlet(height.shape), id=f"{name}, {outlet.__name__}")
        for name, height in TERRAINS.items()
        for outlet in (border, corner)
    ]


def priority_flood(height: Grid, outlet: NDArray[np.uint8]) -> Grid:
    """Return the filled terrain by the textbook: a heap that grows inwards from the outlets."""
    rows, cols = height.shape
    level = height.copy()
    seen = outlet != 0
    heap = [(int(height[row, col]), row, col) for row, col in np.argwhere(seen).tolist()]
    heapq.heapify(heap)
    while heap:
        water, row, col = heapq.heappop(heap)
        for i in range(max(0, row - 1), min(rows, row + 2)):
            for j in range(max(0, col - 1), min(cols, col + 2)):
                if not seen[i, j]:
                    seen[i, j] = True
                    level[i, j] = max(water, int(height[i, j]))
                    heapq.heappush(heap, (int(level[i, j]), i, j))
    return level


# --- the tree -------------------------------------------------------------------------------


@pytest.mark.parametrize("method", routing.METHODS)
@pytest.mark.parametrize(("height", "outlet"), cases())
def test_every_cell_reaches_an_outlet_over_neighbours(
    height: Grid, outlet: NDArray[np.uint8], method: str
) -> None:
    routed = routing.route(height, outlet, method=method, seed=SEED)
    cols = height.shape[1]
    number = np.arange(height.size)
    receiver = routed.receiver.ravel()
    assert np.array_equal(receiver == number, outlet.ravel() != 0)
    assert (np.abs(receiver // cols - number // cols) <= 1).all()
    assert (np.abs(receiver % cols - number % cols) <= 1).all()
    end = number
    for _ in range(height.size):
        if outlet.ravel()[end].all():
            break
        end = receiver[end]
    assert outlet.ravel()[end].all()
    assert np.array_equal(routing.outlets(routed).ravel(), end)


@pytest.mark.parametrize("method", routing.METHODS)
@pytest.mark.parametrize(("height", "outlet"), cases())
def test_water_rises_no_higher_than_priority_flood(
    height: Grid, outlet: NDArray[np.uint8], method: str
) -> None:
    routed = routing.route(height, outlet, method=method, seed=SEED)
    assert np.array_equal(routing.filled(routed, height), priority_flood(height, outlet))


def test_cells_outside_depressions_keep_the_steepest_descent() -> None:
    row, col = np.indices((30, 40))
    height = (100 * row + 37 * col).astype(np.int32)  # 137 / sqrt(2) < 100: due north wins
    receiver = routing.route(height, border(height.shape)).receiver
    inside = np.s_[1:-1, 1:-1]
    assert np.array_equal(receiver[inside], (row * 40 + col - 40)[inside])
    height = (100 * row + 47 * col).astype(np.int32)  # 147 / sqrt(2) > 100: the diagonal wins
    receiver = routing.route(height, border(height.shape)).receiver
    assert np.array_equal(receiver[inside], (row * 40 + col - 41)[inside])


@pytest.mark.parametrize(("height", "outlet"), cases())
def test_area_counts_every_cell_once(height: Grid, outlet: NDArray[np.uint8]) -> None:
    routed = routing.route(height, outlet)
    receiver, area = routed.receiver.ravel(), routed.area.ravel()
    assert area[outlet.ravel() != 0].sum() == height.size
    expected = np.zeros(height.size, np.int32)
    cell = np.arange(height.size)
    while cell.size:  # every cell walks to its outlet and counts where it passes
        np.add.at(expected, cell, 1)
        cell = receiver[cell[receiver[cell] != cell]]
    assert np.array_equal(area, expected)


def test_accumulated_ones_are_the_area_and_rain_is_not_lost() -> None:
    height = hills(60, 50)
    outlet = border(height.shape)
    routed = routing.route(height, outlet)
    assert np.array_equal(routing.accumulate(routed, np.ones_like(height)), routed.area)
    rain = np.random.default_rng(1).random(height.shape, np.float32)
    discharge = routing.accumulate(routed, rain)[outlet != 0].sum(dtype=np.float64)
    assert discharge == pytest.approx(rain.sum(dtype=np.float64), rel=1e-6)
    with pytest.raises(ParameterError, match="weight: needs int32 or float32"):
        routing.accumulate(routed, rain.astype(np.float64))


@pytest.mark.parametrize(("height", "outlet"), cases())
def test_paths_cover_every_cell_once_and_join_earlier_levels(
    height: Grid, outlet: NDArray[np.uint8]
) -> None:
    routed = routing.route(height, outlet)
    receiver, main_donor = routed.receiver.ravel(), routed.paths.main_donor.ravel()
    offsets = routed.paths.offsets
    level = np.full(height.size, -1)
    for number in range(len(offsets) - 1):
        for head in routed.paths.heads[offsets[number] : offsets[number + 1]].tolist():
            assert receiver[head] == head or 0 <= level[receiver[head]] < number
            cell = head
            while cell >= 0:
                assert level[cell] == -1
                level[cell] = number
                assert main_donor[cell] < 0 or receiver[main_donor[cell]] == cell
                cell = main_donor[cell]
    assert (level >= 0).all()
    assert len(offsets) - 1 <= np.log2(height.size) + 1


def test_length_counts_axial_and_diagonal_steps() -> None:
    height = hills(60, 50)
    routed = routing.route(height, corner(height.shape))
    receiver = routed.receiver.ravel().tolist()
    for start in (10, 1234, 2999):
        axial, diagonal, cell = 0, 0, start
        while receiver[cell] != cell:
            step = abs(receiver[cell] - cell)
            axial, diagonal = axial + (step in (1, 50)), diagonal + (step in (49, 51))
            cell = receiver[cell]
        length = routing.flow_length(routed).ravel()[start]
        assert length == pytest.approx(axial + diagonal * 2**0.5, rel=1e-6)


def test_turning_the_terrain_turns_the_flow() -> None:
    random = np.random.default_rng(0)
    height = random.permutation(48 * 37).astype(np.int32).reshape(48, 37) * 1013

    def steps(height: Grid) -> tuple[Grid, Grid]:
        receiver = routing.route(height, border(height.shape)).receiver
        row, col = np.indices(height.shape)
        return receiver // height.shape[1] - row, receiver % height.shape[1] - col

    down, right = steps(height)
    turned_down, turned_right = steps(np.rot90(height).copy())  # east becomes north
    assert np.array_equal(turned_down, np.rot90(-right))
    assert np.array_equal(turned_right, np.rot90(down))


def test_flow_across_a_plain_is_not_aligned_with_the_grid() -> None:
    height = np.zeros((80, 80), np.int32)
    receiver = routing.route(height, border(height.shape)).receiver.ravel()
    number = np.arange(height.size)
    steps = (receiver - number)[border(height.shape).ravel() == 0]
    shares = [np.mean(steps == step) for step in (-81, -80, -79, -1, 1, 79, 80, 81)]
    assert min(shares) > 0.08
    assert max(shares) < 0.18


def test_the_seed_decides_between_equal_passes_only() -> None:
    flat = np.zeros((40, 40), np.int32)
    outlet = border(flat.shape)
    one, other = (routing.route(flat, outlet, seed=(s, 0)).receiver for s in (1, 2))
    assert (one != other).mean() > 0.3
    height = noise(40, 40, 2**30 - 1)
    one, other = (routing.route(height, outlet, seed=(s, 0)).receiver for s in (1, 2))
    assert np.array_equal(one, other)


# --- direction ------------------------------------------------------------------------------


def mean_direction(method: str, degrees: float) -> float:
    """Return the mean direction of flow down a plane, in degrees from north towards west."""
    row, col = np.indices((120, 120))
    angle = np.radians(degrees)
    height = np.round(1e5 * (row * np.cos(angle) + col * np.sin(angle))).astype(np.int32)
    receiver = routing.route(height, border(height.shape), method=method, seed=SEED).receiver
    inside = np.s_[1:-1, 1:-1]
    up = (row - receiver // 120)[inside].mean()
    left = (col - receiver % 120)[inside].mean()
    return float(np.degrees(np.arctan2(left, up)))


@pytest.mark.parametrize("degrees", [10.0, 22.5, 35.0, 60.0])
def test_rho8_follows_the_aspect_of_a_plane_in_the_mean(degrees: float) -> None:
    assert mean_direction("rho8", degrees) == pytest.approx(degrees, abs=1.0)


@pytest.mark.parametrize(("degrees", "taken"), [(10, 0), (20, 0), (25, 45), (60, 45), (70, 90)])
def test_d8_flows_along_the_nearest_of_eight_directions(degrees: float, taken: float) -> None:
    # At 22.5 degrees axis and diagonal are equally steep, and rounding decides cell by cell
    assert mean_direction("d8", degrees) == pytest.approx(taken, abs=1e-9)


def test_rho8_is_a_function_of_world_coordinates() -> None:
    height = hills(60, 60)
    row, col = np.indices(height.shape)
    height = height // 100 + (20000 * row + 9000 * col).astype(np.int32)  # no depressions
    whole = routing.route(height, border(height.shape), method="rho8", origin=(5, -6)).receiver
    part = np.ascontiguousarray(height[20:50, 10:40])
    tile = routing.route(part, border(part.shape), method="rho8", origin=(25, 4)).receiver
    inside = np.s_[1:-1, 1:-1]
    whole_steps = (whole - row * 60 - col)[20:50, 10:40][inside]
    row, col = np.indices(part.shape)
    down, right = tile // 30 - row, tile % 30 - col
    assert np.array_equal(whole_steps, (down * 60 + right)[inside])


# --- measures of rivers ---------------------------------------------------------------------


def test_strahler_order_rises_where_equals_meet() -> None:
    # 0 and 1 meet in 2 (order 2), 3 joins in 4 (still 2), 5 and 6 meet in 7, both meet in 8
    receiver = np.array([[2, 2, 4, 4, 8, 7, 7, 8, 8]], np.int32)
    assert routing.strahler_order(receiver).tolist() == [[1, 1, 2, 1, 2, 1, 1, 2, 3]]


def test_longest_length_is_the_farthest_source() -> None:
    receiver = np.array([[0, 0, 1], [0, 4, 4], [3, 4, 4]], np.int32)
    longest = routing.longest_length(receiver)
    expected = np.array([[2, 1, 0], [1, 2**0.5, 0], [0, 0, 0]])
    assert np.allclose(longest, expected, atol=1e-6)


# --- the kernels ----------------------------------------------------------------------------


def assert_equal_on(device: Device, height: Grid, outlet: NDArray[np.uint8], method: str) -> None:
    options: dict[str, Any] = {"method": method, "seed": SEED, "origin": ORIGIN}
    here = routing.route(height, outlet, **options)
    there = routing.route(height, outlet, device=device, **options)
    pairs = {
        "receiver": (here.receiver, there.receiver),
        "area": (here.area, there.area),
        "main_donor": (here.paths.main_donor, there.paths.main_donor),
        "heads": (here.paths.heads, there.paths.heads),
        "filled": (routing.filled(here, height), routing.filled(there, device.upload(height))),
        "outlets": (routing.outlets(here), routing.outlets(there)),
        "flow_length": (routing.flow_length(here), routing.flow_length(there)),
    }
    random = np.random.default_rng(1)
    for weight in (
        random.integers(0, 1000, height.shape).astype(np.int32),
        random.random(height.shape, np.float32),
    ):
        on_device = routing.accumulate(there, device.upload(weight))
        pairs[f"accumulated {weight.dtype}"] = routing.accumulate(here, weight), on_device
    assert here.paths.offsets == there.paths.offsets
    for name, (expected, on_device) in pairs.items():
        found = on_device.download()
        assert found.dtype == expected.dtype, name
        assert np.array_equal(found, expected), name


@pytest.mark.parametrize("method", routing.METHODS)
@pytest.mark.parametrize(("height", "outlet"), cases())
def test_kernels_equal_the_reference(
    device: Device, height: Grid, outlet: NDArray[np.uint8], method: str
) -> None:
    assert_equal_on(device, height, outlet, method)


@pytest.mark.parametrize("work_group", [1, 7])
@pytest.mark.parametrize("name", ["hills", "rough integers", "flat", "one column"])
def test_work_groups_change_nothing(device: Device, name: str, work_group: int) -> None:
    height = TERRAINS[name]
    assert_equal_on(device.with_work_group(work_group), height, border(height.shape), "d8")
    assert_equal_on(device.with_work_group(work_group), height, corner(height.shape), "rho8")


@pytest.mark.parametrize(
    "height", [hills(300, 400), hills(300, 400, 0.05), noise(300, 400, 2**30 - 1)]
)
def test_kernels_equal_the_reference_on_larger_terrains(device: Device, height: Grid) -> None:
    outlet = border(height.shape)
    outlet[100:120, 200:230] = 1  # a lake without a river
    assert_equal_on(device, height, outlet, "d8")


def test_inputs_stay_as_they_are(device: Device) -> None:
    height, outlet = hills(40, 40), border((40, 40))
    on_device = device.upload(height), device.upload(outlet)
    routing.route(*on_device, device=device)
    assert np.array_equal(on_device[0].download(), height)
    assert np.array_equal(on_device[1].download(), outlet)


# --- refusals -------------------------------------------------------------------------------


def test_a_terrain_without_outlet_is_refused(device: Device) -> None:
    for height in (hills(20, 20), np.zeros((1, 1), np.int32)):
        nowhere = np.zeros(height.shape, np.uint8)
        with pytest.raises(ParameterError, match="no cell is an outlet"):
            routing.route(height, nowhere)
        with pytest.raises(ParameterError, match="no cell is an outlet"):
            routing.route(device.upload(height), device.upload(nowhere), device=device)


def test_unusable_arrays_are_refused() -> None:
    height, outlet = hills(20, 20), border((20, 20))
    with pytest.raises(ParameterError, match="height: needs int32"):
        routing.route(height.astype(np.float32), outlet)
    with pytest.raises(ParameterError, match="outlet: needs uint8"):
        routing.route(height, outlet[1:])
    with pytest.raises(ParameterError, match="method: 'd9'"):
        routing.route(height, outlet, method="d9")
    with pytest.raises(ParameterError, match="larger quantum"):
        routing.route(np.full((20, 20), 2**30, np.int32), outlet)
