"""Lattice noise: the same bits everywhere, smooth, alike in all directions, and never repeating."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit.compute import Device, choose_device
from terrakit.noise import BASES, basis_functions, reference, source
from terrakit.noise.classic import classic_perlin, corner_direction
from terrakit.noise.reference import FEATURES, METRICS, RANGES, Feature, Metric

Numbers = NDArray[np.float64]
SMOOTH = ("value", "gradient", "simplex")
SEED = (0x12345678, 0x9ABCDEF0)
SKEW = (np.sqrt(3.0) - 1) / 2
BELOW_ONE = np.float32(1 - 2.0**-24)


def places(count: int, seed: int = 0) -> tuple[Any, ...]:
    """Return cells anywhere, the last and first among them, and fractions, 0 among them."""
    random = np.random.default_rng(seed)
    i, j = random.integers(-(2**31), 2**31, (2, count)).astype(np.int32)
    x, y = (random.integers(0, 2**24, (2, count)) / 2**24).astype(np.float32)
    i[:4], j[:4] = (2**31 - 1, -(2**31), -1, 0), (0, 2**31 - 1, -(2**31), -1)
    x[:40:2], y[:40:4], x[40:60], y[50:70] = 0, 0, 0.5, BELOW_ONE
    return i, j, x, y


def at(name: str, x: Any, y: Any, seed: tuple[int, int] = SEED) -> Numbers:
    """Return noise at straight positions in cells, skewed where the basis wants it."""
    i, j, fx, fy = split(name, x, y)
    return BASES[name].numpy(i, j, fx, fy, *seed).astype(np.float64)


def split(name: str, x: Any, y: Any) -> tuple[Any, ...]:
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if BASES[name].is_skewed:
        along = SKEW * (x + y)
        x, y = x + along, y + along
    i, j = np.floor(x), np.floor(y)
    return i.astype(np.int64), j.astype(np.int64), x - i, y - j


# The same bits -----------------------------------------------------------------------------------


def kernel(name: str, calls: list[str], lanes: int) -> str:
    """Return a kernel that writes what each call returns, 64 places a work-item."""
    writes = "\n".join(f"out[{n} * count + c] = {call};" for n, call in enumerate(calls))
    return f"""
        __kernel void {name}(
            __global const int *i, __global const int *j, __global const float *x,
            __global const float *y, __global float *out, const uint low, const uint high,
            const int count)
        {{
            const int first = (int)get_global_id(0) * 64;
            const int end = first + 64 < count ? first + 64 : count;
        #ifdef TERRAKIT_CPU
            NOISE_LOOP_OF({lanes})
        #endif
            for (int c = first; c < end; ++c) {{ float dx, dy; {writes} }}
        }}
    """


def named(metric: Metric, *features: Feature) -> list[str]:
    return [f"cellular_{f}" + ("" if metric == "euclidean" else f"_{metric}") for f in features]


GROUPS: dict[str, list[str]] = {
    "lattice": ["white", *SMOOTH],
    **{m: named(m, *(FEATURES if m == "euclidean" else ("f1", "f2_minus_f1"))) for m in METRICS},
}
"""What differs between metrics is how they measure, and numbers that another test reads."""


@pytest.mark.parametrize("group", GROUPS)
def test_kernels_return_the_bits_of_the_reference(group: str) -> None:
    device = Device(choose_device(None))
    if not device.info.is_opencl:
        pytest.skip("no OpenCL device")
    count = 3001
    i, j, x, y = places(count)
    calls, expected = [], []
    for name in GROUPS[group]:
        basis = BASES[name]
        calls.append(f"{basis.opencl}(i[c], j[c], x[c], y[c], low, high)")
        expected.append(basis.numpy(i, j, x, y, *SEED))
        if basis.numpy_slope is not None:
            slopes = basis.numpy_slope(i, j, x, y, *SEED)
            assert slopes[0].tobytes() == expected[-1].tobytes()
            for part, values in zip(("dx", "dy"), slopes[1:], strict=True):
                call = f"{basis.opencl}_slope(i[c], j[c], x[c], y[c], low, high, &dx, &dy)"
                calls.append(f"({call}, {part})")
                expected.append(values)
    text = source(BASES) + kernel(f"noise_{group}", calls, 16)
    out = device.empty((len(calls), count))
    device.program_from_source("noise.cl", text).launch(
        f"noise_{group}",
        (-(-count // 64),),
        *(device.upload(values) for values in (i, j, x, y)),
        out,
        *(np.uint32(word) for word in SEED),
        np.int32(count),
        local=(1,),
    )
    for call, ours, theirs in zip(calls, out.download(), expected, strict=True):
        assert ours.tobytes() == theirs.tobytes(), call


def test_kernels_know_the_ranges_and_searches_of_the_reference() -> None:
    text = source(BASES)
    said = dict(re.findall(r"#define NOISE_SPREAD_(\w+) ([\d.]+)f", text))
    searches = re.findall(r"^NOISE_CELLULAR\((\w*), (\w+), (\d), (\d)\)", text, re.MULTILINE)
    assert [metric for _, metric, _, _ in searches] == list(METRICS)
    for suffix, metric, first, more in searches:
        assert suffix == ("" if metric == "euclidean" else f"_{metric}")
        for feature in FEATURES:
            across = reference.cells_across(feature, metric)
            assert across == int(first if feature in ("f1", "value") else more)
            if feature not in ("crackle", "value"):
                key = f"{metric}_{feature.replace('f2_minus_f1', 'gap')}"
                assert np.float32(said.pop(key)) == np.float32(2 / RANGES[metric][feature])
    assert not said


def test_cells_wrap_and_any_integers_will_do() -> None:
    i, j, x, y = places(50)
    for basis in BASES.values():
        here = basis.numpy(i, j, x, y, *SEED)
        there = basis.numpy(i.astype(np.int64) + 2**32, j.astype(np.uint32), x, y, *SEED)
        assert here.tobytes() == there.tobytes()
        assert here.dtype == np.float32


def test_every_basis_is_named_once_and_has_its_functions() -> None:
    text = source(BASES)
    assert list(basis_functions()) == [basis.name for basis in BASES.values()]
    assert len(BASES) == 4 + len(METRICS) * len(FEATURES)
    for name in ("white", *SMOOTH):
        assert f"NOISE float {BASES[name].opencl}(" in text
        assert BASES[name].has_slope == (f"{BASES[name].opencl}_slope(" in text)


# What the values are -----------------------------------------------------------------------------


@pytest.mark.parametrize("name", BASES)
def test_values_keep_to_the_bound_and_spread_as_said(name: str) -> None:
    basis = BASES[name]
    wanted = 12_000 if name.startswith("cellular") else 200_000
    random = np.random.default_rng(3)
    i, j = random.integers(-(2**31), 2**31, (2, wanted))
    x, y = random.random((2, wanted))
    values = basis.numpy(i, j, x, y, *SEED).astype(np.float64)
    assert np.abs(values).max() <= basis.bound
    error = 5 / np.sqrt(wanted)
    assert values.mean() == pytest.approx(basis.mean, abs=error * basis.deviation + 1e-3)
    assert values.std() == pytest.approx(basis.deviation, rel=error, abs=1e-3)


@pytest.mark.parametrize(("name", "x", "y"), [("gradient", 0.5, 0.35), ("simplex", 0.9625, 0.595)])
def test_the_bound_is_reached_where_all_gradients_agree(name: str, x: float, y: float) -> None:
    random = np.random.default_rng(4)
    i, j = random.integers(-(2**31), 2**31, (2, 400_000))
    assert 0.97 < np.abs(BASES[name].numpy(i, j, x, y, *SEED)).max() <= 1


@pytest.mark.parametrize("name", ["gradient", "simplex"])
def test_lattice_points_are_zero(name: str) -> None:
    i, j, _, _ = places(1000)
    assert (BASES[name].numpy(i, j, 0.0, 0.0, *SEED) == 0).all()
    assert (BASES[name].numpy(i, j, 0.3, 0.4, *SEED) != 0).all()


def test_white_is_one_value_a_cell_and_value_noise_meets_its_lattice() -> None:
    i, j, x, y = places(1000)
    assert np.array_equal(
        reference.white(i, j, x, y, *SEED), reference.white(i, j, 0.0, 0.0, *SEED)
    )
    east = reference.value(i.astype(np.int64) + 1, j, 0.0, 0.0, *SEED)
    assert reference.value(i, j, BELOW_ONE, 0.0, *SEED) == pytest.approx(east, abs=4e-6)


# Smoothness --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SMOOTH)
def test_slope_is_that_of_the_values(name: str) -> None:
    random = np.random.default_rng(5)
    x, y = random.uniform(-50, 50, (2, 5000))
    step = 1 / 256
    slope = BASES[name].numpy_slope
    assert slope is not None
    _, dx, dy = slope(*split(name, x, y), *SEED)
    east = (at(name, x + step, y) - at(name, x - step, y)) / (2 * step)
    north = (at(name, x, y + step) - at(name, x, y - step)) / (2 * step)
    assert np.abs(dx - east).max() < 3e-3
    assert np.abs(dy - north).max() < 3e-3
    assert np.abs(dx).max() > 1


@pytest.mark.parametrize("name", SMOOTH)
def test_nothing_jumps_across_cells(name: str) -> None:
    i, j, _, along = places(2000)
    slope = BASES[name].numpy_slope
    assert slope is not None
    far = i.astype(np.int64) + 1
    for turned in (False, True):
        inside = (i, j, BELOW_ONE, along) if not turned else (j, i, along, BELOW_ONE)
        across = (far, j, 0.0, along) if not turned else (j, far, along, 0.0)
        for here, there in zip(slope(*inside, *SEED), slope(*across, *SEED), strict=True):
            assert here == pytest.approx(there, abs=2e-5)
    # Triangles also meet on the diagonal of a cell
    nudged = np.minimum(along + np.float32(2.0**-20), BELOW_ONE)
    for here, there in zip(
        slope(i, j, nudged, along, *SEED), slope(i, j, along, nudged, *SEED), strict=True
    ):
        assert here == pytest.approx(there, abs=1e-4)


@pytest.mark.parametrize("name", ["value", "gradient"])
def test_curvature_does_not_jump_across_cells(name: str) -> None:
    # Quintics: erosion and shading show a lattice where curvature jumps, as cubics' does
    step = 2.0**-7
    random = np.random.default_rng(6)
    j, along = random.integers(-1000, 1000, 3000), random.random(3000)
    slope = BASES[name].numpy_slope
    assert slope is not None

    def bend(cell: int, x: float) -> Numbers:
        return (
            slope(cell, j, x + step, along, *SEED)[1] - slope(cell, j, x, along, *SEED)[1]
        ).astype(np.float64) / step

    before, after = bend(7, 1 - step - 2.0**-24), bend(8, 0.0)
    inside = np.abs(bend(7, 0.25)).max()
    assert np.abs(after - before).max() < 0.2 * inside


# Directions --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gradient", "simplex", "cellular_f1"])
@pytest.mark.parametrize("lag", [0.1, 0.4, 1.0])
def test_directions_are_alike(name: str, lag: float) -> None:
    random = np.random.default_rng(7)
    count = 150_000
    x, y = random.uniform(-3000, 3000, (2, count))
    here = at(name, x, y)
    energy = []
    for angle in np.radians([0, 30, 45, 90, 120, 135]):
        there = at(name, x + lag * np.cos(angle), y + lag * np.sin(angle))
        energy.append(((there - here) ** 2).mean())
    assert max(energy) / min(energy) < 1.05


@pytest.mark.parametrize(("name", "most"), [("gradient", 1.15), ("simplex", 1.25)])
def test_ground_faces_all_directions_alike(name: str, most: float) -> None:
    random = np.random.default_rng(7)
    i, j = random.integers(-(2**31), 2**31, (2, 300_000))
    slope = BASES[name].numpy_slope
    assert slope is not None
    _, dx, dy = slope(i, j, *random.random((2, 300_000)), *SEED)
    faced = np.histogram(np.arctan2(dy, dx), 24, (-np.pi, np.pi))[0]
    assert faced.max() / faced.min() < most


# Hashes ------------------------------------------------------------------------------------------


def lattice(side: int, west: int, south: int, seed: tuple[int, int]) -> NDArray[np.float32]:
    """Return the uniform numbers in [-1, 1] at lattice points, before they are spread."""
    along = np.arange(side)
    return reference.value((west + along)[None, :], (south + along)[:, None], 0.0, 0.0, *seed)


CORNERS = [(0, 0), (-257, -256), (2**31 - 300, 123_456_789), (1 << 20, -(1 << 24))]


@pytest.mark.parametrize("corner", CORNERS)
@pytest.mark.parametrize("seed", [(0, 0), (1, 0), (0, 1), SEED])
def test_lattice_hashes_look_random(corner: tuple[int, int], seed: tuple[int, int]) -> None:
    side = 512
    t = lattice(side, *corner, seed)
    counts = np.histogram(t, 64, (-1, 1))[0]
    expected = side * side / 64
    assert ((counts - expected) ** 2 / expected).sum() < 63 + 5 * np.sqrt(2 * 63)
    for harmonic in (1, 2, 3):
        circle = np.exp(1j * np.pi * harmonic * t.astype(np.float64))
        spectrum = np.abs(np.fft.fft2(circle)) ** 2 / side**2
        # No period, no direction: the largest of n exponential numbers is near log(n)
        assert spectrum.max() < np.log(side**2) + 8
        # No likeness of neighbours at any distance
        likeness = np.abs(np.fft.ifft2(spectrum))
        likeness[0, 0] = 0
        assert likeness.max() < 6 / side
        # No sum of a column's and a row's number: that would show as rectangles
        for apart in (1, 2, 3, 8):
            a, b = circle[:-apart, :-apart], circle[:-apart, apart:]
            c, d = circle[apart:, :-apart], circle[apart:, apart:]
            assert abs((a * d * np.conj(b * c)).mean()) < 5 / side


def test_points_of_cells_fill_them_evenly() -> None:
    along = np.arange(400)
    x, y = reference.cell_points(along[None, :], along[:, None], *SEED)
    counts = np.histogram2d(x.ravel(), y.ravel(), 16, [[0, 1], [0, 1]])[0]
    expected = counts.sum() / counts.size
    assert ((counts - expected) ** 2 / expected).sum() < 255 + 5 * np.sqrt(2 * 255)
    for a, b in ((x, y), (x[:, 1:], x[:, :-1]), (y[1:], y[:-1]), (x[1:], y[:-1])):
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 0.015


@pytest.mark.parametrize("name", ["white", *SMOOTH, "cellular_f1", "cellular_value"])
def test_seeds_are_unlike(name: str) -> None:
    random = np.random.default_rng(8)
    i, j = random.integers(0, 1000, (2, 30_000))
    x, y = random.random((2, 30_000))
    low, high = SEED
    others = [(low ^ 1, high), (low, high ^ 1), (low ^ 1 << 31, high), (low + 3, high), (high, low)]
    made = [BASES[name].numpy(i, j, x, y, *seed) for seed in (SEED, *others)]
    likeness = np.corrcoef(made) - np.eye(len(made))
    # Points near the middle of cells are near one whatever the seed
    assert np.abs(likeness).max() < (0.04 if name == "cellular_f1" else 0.025)


def test_both_words_of_a_seed_count_in_every_bit() -> None:
    i, j = np.arange(64), np.zeros(64, int)
    low, high = SEED
    seeds = [
        SEED,
        *((low ^ 1 << n, high) for n in range(32)),
        *((low, high ^ 1 << n) for n in range(32)),
    ]
    made = {reference.white(i, j, 0, 0, *seed).tobytes() for seed in seeds}
    assert len(made) == len(seeds)


# Perlin's own noise ------------------------------------------------------------------------------


def test_classic_noise_is_perlins() -> None:
    assert classic_perlin(3.14, 42, 7) == 0.13691995878400012
    assert classic_perlin(-4.25, 0.0, 300.5) == classic_perlin(251.75, 256.0, 44.5) != 0


def test_gradient_noise_joins_gradients_as_perlin_did() -> None:
    random = np.random.default_rng(9)
    i, j = random.integers(-500, 500, (2, 5000))
    x, y = random.random((2, 5000)).astype(np.float32)
    corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)]
    slopes = [
        g.astype(np.float32) for c in corners for g in np.moveaxis(corner_direction(*c), -1, 0)[:2]
    ]
    ours = reference.joined_ramps(tuple(slopes), x, y)[0]
    theirs = classic_perlin(i + x.astype(np.float64), j + y.astype(np.float64))
    assert np.abs(ours - theirs).max() < 4e-6
    assert np.abs(theirs).max() > 0.5


# Cells -------------------------------------------------------------------------------------------

EXACT: dict[Metric, tuple[float, int]] = {
    "euclidean": (2, 4),
    "manhattan": (1, 2),
    "chebyshev": (np.inf, 4),
}


@pytest.mark.parametrize("metric", EXACT)
def test_cellular_distances_are_those_of_all_points(metric: Metric) -> None:
    from scipy.spatial import cKDTree

    west, south, side = -20, 100_000, 40
    cells_i, cells_j = np.meshgrid(
        np.arange(west - 4, west + side + 4), np.arange(south - 4, south + side + 4)
    )
    x, y = reference.cell_points(cells_i, cells_j, *SEED)
    points = (
        np.stack((cells_i - west + x, cells_j - south + y), axis=-1)
        .reshape(-1, 2)
        .astype(np.float64)
    )
    random = np.random.default_rng(10)
    i, j = random.integers(0, side, (2, 20_000))
    fx, fy = random.random((2, 20_000)).astype(np.float32)
    order, exact = EXACT[metric]
    apart, owner = cKDTree(points).query(np.stack((i + fx, j + fy), axis=-1), k=4, p=order)
    suffix = "" if metric == "euclidean" else f"_{metric}"

    def shown(feature: Feature) -> Numbers:
        basis = BASES[f"cellular_{feature}{suffix}"]
        return basis.numpy(i + west, j + south, fx, fy, *SEED).astype(np.float64)

    distances = []
    for rank, feature in enumerate(("f1", "f2", "f3", "f4")):
        distances.append((shown(feature) + 1) * RANGES[metric][feature] / 2)
        if rank < exact:
            assert np.abs(distances[-1] - apart[:, rank]).max() < 1e-5
    assert (np.diff(distances, axis=0) >= -1e-5).all()
    gap = apart[:, 1] - apart[:, 0]
    assert shown("f2_minus_f1") == pytest.approx(
        gap * 2 / RANGES[metric]["f2_minus_f1"] - 1, abs=1e-4
    )
    assert shown("crackle") == pytest.approx(np.minimum(10 * gap, 1) * 2 - 1, abs=1e-3)
    # One height for all that is nearest to a point, another for another point
    heights: dict[int, float] = {}
    clear = gap > 1e-5
    for point, height in zip(owner[clear, 0].tolist(), shown("value")[clear].tolist(), strict=True):
        assert heights.setdefault(point, height) == height
    assert len(set(heights.values())) == len(heights)


def test_distances_of_other_metrics_follow_from_the_points() -> None:
    i, j, x, y = places(2000)
    squared = reference.nearest_points(i, j, x, y, *SEED, "euclidean_squared", 5)
    plain = reference.nearest_points(i, j, x, y, *SEED, "euclidean", 5)
    for a, b in zip(squared.distances, plain.distances, strict=True):
        assert a == pytest.approx(b * b, rel=1e-5)
    own = reference.cell_points(i, j, *SEED)
    apart = [np.abs(p.astype(np.float64) - f) for p, f in zip(own, (x, y), strict=True)]
    half = reference.nearest_points(i, j, x, y, *SEED, "minkowski_half", 5)
    assert (half.distances[0] <= (np.sqrt(apart[0]) + np.sqrt(apart[1])) ** 2 + 1e-4).all()
    assert (half.distances[0] >= plain.distances[0] - 1e-6).all()


@pytest.mark.parametrize("feature", ["f1", "value"])
def test_searching_further_finds_nothing_nearer(feature: Feature) -> None:
    i, j, x, y = places(20_000)
    for metric in ("euclidean", "euclidean_squared", "chebyshev"):
        narrow = reference.nearest_points(i, j, x, y, *SEED, metric, 4, 1)
        wide = reference.nearest_points(i, j, x, y, *SEED, metric, 5, 1)
        assert narrow.distances[0].tobytes() == wide.distances[0].tobytes()
        assert np.array_equal(narrow.point, wide.point) or feature == "f1"


def test_every_function_takes_plain_numbers() -> None:
    functions: list[Callable[..., Any]] = [basis.numpy for basis in BASES.values()]
    for evaluate in functions:
        assert evaluate(-3, 5, 0.25, 0.5, *SEED).shape == (1,)
