"""Formulas: what is written is what is computed, in both languages, on any tile."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Heightfield, ParameterError, Run
from terrakit import formula as f
from terrakit.formula.opencl import _Kernel
from terrakit.formula.plan import Plan

Field = NDArray[np.float32]
GRID = Grid((37, 300), 10.0, (1234.5, -77.7))


def computed(make: Callable[[f.Place], f.Formula], device: str | None, grid: Grid = GRID) -> Field:
    place = f.Place(grid, Run(3, device))
    (values,) = place.computed(make(place))
    return np.asarray(values if isinstance(values, np.ndarray) else values.download())


def both(make: Callable[[f.Place], f.Formula], grid: Grid = GRID) -> Field:
    """Return the values after checking that NumPy and the device give the same bits."""
    reference, ours = computed(make, "numpy", grid), computed(make, None, grid)
    assert np.array_equal(reference.view(np.int32), ours.view(np.int32))
    return reference


def octaves(place: f.Place, stream: str = "t", count: int = 5) -> f.Octaves:
    return place.octaves("gradient", 500.0, count, place.words(stream, 1))


X, Y = 0.001, 0.002
FUNCTIONS: dict[str, tuple[Callable[..., f.Formula], Callable[..., object], float]] = {
    "sine": (lambda x, y: f.sine(x * X), lambda x, y: np.sin(x * X), 1e-6),
    "cosine": (lambda x, y: f.cosine(x * X), lambda x, y: np.cos(x * X), 1e-6),
    "arctangent": (f.arctangent, np.arctan2, 1e-5),
    "exp": (lambda x, y: f.exp(x * X), lambda x, y: np.exp(x * X), 1e-5),
    "log": (lambda x, y: f.log(abs(x) + 1.0), lambda x, y: np.log(abs(x) + 1.0), 1e-5),
    "power": (
        lambda x, y: f.power(abs(y) * Y, 1.7),
        lambda x, y: (abs(y) * Y) ** 1.7,
        1e-5,
    ),
    "power of a formula": (
        lambda x, y: f.power(abs(y) * Y, 1.0 + x * 1e-4),
        lambda x, y: (abs(y) * Y) ** (1.0 + x * 1e-4),
        1e-5,
    ),
    "tanh": (lambda x, y: f.tanh(x * X), lambda x, y: np.tanh(x * X), 1e-5),
    "hypot": (f.hypot, np.hypot, 1e-3),
    "floor": (lambda x, y: f.floor(x / 70.0), lambda x, y: np.floor(x / 70.0), 0.0),
    "fraction": (lambda x, y: f.fraction(x / 64.0), lambda x, y: (x / 64.0) % 1.0, 1e-4),
    "whole power": (lambda x, y: (x * X) ** 3, lambda x, y: (x * X) ** 3, 1e-5),
    "clamp": (lambda x, y: f.clamp(x, y, 300.0), lambda x, y: np.clip(x, y, 300.0), 0.0),
    "where": (
        lambda x, y: f.where((x < 3.0) & ~(y >= 0.0) | (x > 900.0), x, -y),
        lambda x, y: np.where((x < 3) & ~(y >= 0) | (x > 900), x, -y),
        0.0,
    ),
    "lerp": (lambda x, y: f.lerp(x, y, 0.25), lambda x, y: x + (y - x) * 0.25, 1e-3),
    "polynomial": (
        lambda x, y: f.polynomial(x * X, 1.0, -2.0, 3.0),
        lambda x, y: 1.0 - 2.0 * x * X + 3.0 * (x * X) ** 2,
        1e-5,
    ),
    "smoothstep": (
        lambda x, y: f.smoothstep(-300.0, 500.0, x),
        lambda x, y: (lambda t: t**3 * (t * (6 * t - 15) + 10))(np.clip((x + 300) / 800, 0, 1)),
        1e-5,
    ),
}


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_functions_are_what_they_are_called(name: str) -> None:
    ours, theirs, tolerance = FUNCTIONS[name]
    values = both(lambda place: ours(*place.around(None)), Grid((37, 300), 10.0))
    x = (np.arange(300) - 149.5)[None, :] * 10.0
    y = (18.0 - np.arange(37))[:, None] * 10.0
    expected = np.broadcast_to(np.asarray(theirs(x, y)), values.shape)
    assert np.abs(values - expected).max() <= tolerance * max(1.0, float(np.abs(expected).max()))


def test_smooth_minimum_is_below_both_and_equal_far_away() -> None:
    values = both(
        lambda p: f.smooth_minimum(p.around()[0], p.around()[1] * 3.0, 200.0),
        Grid((37, 300), 10.0),
    )
    x = (np.arange(300) - 149.5)[None, :] * 10.0
    y = (18.0 - np.arange(37))[:, None] * 30.0
    least = np.minimum(x, y)
    assert (values <= least + 1e-3).all()
    far = np.abs(x - y) > 200.0
    assert np.array_equal(values[far], least[far].astype(np.float32))
    assert (least - values).max() == pytest.approx(200.0 / 6.0, rel=0.1)


def test_constants_fold() -> None:
    folded = f.constant(2.0) * 3.0 + f.maximum(f.constant(1.0), 5.0)
    assert (folded.op, folded.data) == ("constant", 11.0)
    assert (both(lambda place: folded) == 11.0).all()


def test_a_formula_has_no_truth() -> None:
    with pytest.raises(TypeError, match="where"):
        bool(f.constant(1.0) < f.constant(2.0))


@pytest.mark.parametrize("cols", [1, 2, 255, 256, 257, 513])
def test_any_width_gives_the_same(cols: int) -> None:
    def make(place: f.Place) -> f.Formula:
        return f.fbm(octaves(place)) * place.x + place.y

    whole = both(make, Grid((3, 520), 10.0, (0.0, 0.0)))
    part = both(make, Grid((3, cols), 10.0, (0.0, 0.0)))
    assert np.array_equal(whole[:, :cols], part)


def test_around_turns_clockwise_from_north() -> None:
    grid = Grid((5, 5), 10.0)
    right, ahead = (both(lambda p, i=i: p.around([20.0, 20.0], 90.0)[i], grid) for i in (0, 1))
    assert ahead[2, 4] == pytest.approx(20.0, abs=1e-4)  # looking east, east is ahead
    assert right[4, 2] == pytest.approx(20.0, abs=1e-4)  # and south is to the right


def test_a_tile_lies_in_the_middle_of_its_world() -> None:
    whole = Grid((65, 65), 10.0, (500.0, 900.0))
    tile = Grid((9, 7), 10.0, (500.0 + 80.0, 900.0 - 110.0))
    run = Run(1, "numpy", world=whole)
    place = f.Place(tile, run)
    (x,) = place.computed(place.around()[0])
    assert x[0, 0] == 80.0 - 320.0
    # by sample, not by tile: the same in every tile


FRACTALS: dict[str, Callable[[f.Octaves], f.Formula]] = {
    "fbm": f.fbm,
    "billow": f.billow,
    "turbulence": f.turbulence,
    "ridged_multifractal": lambda o: f.ridged_multifractal(o, 1.0, 2.0),
    "hybrid_multifractal": lambda o: f.hybrid_multifractal(o, 0.7, 1.0),
    "heterogeneous_terrain": lambda o: f.heterogeneous_terrain(o, 0.7),
    "multifractal": lambda o: f.multifractal(o, 1.0),
    "slope_damped": lambda o: f.slope_damped(o, 1.0),
    "swiss": lambda o: f.swiss(o, 0.15),
    "jordan": lambda o: f.jordan(o, 0.4, 1.0),
}


@pytest.mark.parametrize("name", sorted(FRACTALS))
def test_fractals_agree_in_both_languages_and_on_tiles(name: str) -> None:
    def make(place: f.Place) -> f.Formula:
        return FRACTALS[name](octaves(place))

    whole = both(make)
    tile = Grid((20, 40), 10.0, (1234.5 + 50 * 10.0, -77.7 - 7 * 10.0))
    assert np.array_equal(whole[7:27, 50:90], both(make, tile))
    assert whole.std() > 0.02


def test_deeper_octaves_than_one_add_detail_in_the_right_order() -> None:
    one, five = (both(lambda p, n=n: f.fbm(octaves(p, count=n))) for n in (1, 5))
    rough = [np.abs(np.diff(z, 2, axis=1)).mean() for z in (one, five)]
    assert rough[1] > 2.0 * rough[0]


def test_loops_feed_each_other() -> None:
    """Noise displaced by noise displaced by noise, whose results multiply a sum of octaves."""

    def make(place: f.Place) -> f.Formula:
        at = place
        for bend in range(3):
            east = f.fbm(octaves(at, f"east {bend}")) * 200.0
            at = place.displaced(east, f.fbm(octaves(at, f"north {bend}")) * 200.0)
        x, _ = at.around()
        return f.fbm(octaves(at)) * 100.0 + f.ridged_multifractal(octaves(at), 1.0, 2.0) * x

    assert np.isfinite(both(make)).all()


def test_displacement_moves_the_terrain() -> None:
    still = both(lambda p: f.fbm(octaves(p)))
    moved = both(lambda p: f.fbm(octaves(p.displaced(70.0, -30.0))))
    assert np.abs(moved[:-3, :-7] - still[3:, 7:]).max() < 2e-4


def test_displacement_by_anything_is_survived() -> None:
    for far in (1e30, -1e30, math.inf, math.nan, 1e9):
        values = both(lambda p, far=far: f.fbm(octaves(p.displaced(far, far))))
        assert np.isfinite(values).all()


def test_slope_of_noise_is_its_slope() -> None:
    grid = Grid((64, 64), 1.0)

    def make(place: f.Place, part: int) -> f.Formula:
        sums = place.octaves("gradient", 97.0, 3, place.words("t", 1), gain=0.6)
        value, east, north = sums.slope()
        scale = sums.table([1.0 / w for w in sums.wavelengths])
        body = (value, east * scale, north * scale)[part]
        return sums.sum([0.0], lambda total: [total + sums.height * body])[0]

    height, east, north = (both(lambda p, k=k: make(p, k), grid).astype(float) for k in range(3))
    assert np.abs(np.gradient(height, axis=1) - east)[1:-1, 1:-1].max() < 4e-3
    assert np.abs(-np.gradient(height, axis=0) - north)[1:-1, 1:-1].max() < 4e-3
    assert np.abs(east).max() > 0.02


def test_layers_and_masks_are_fields() -> None:
    mask = np.linspace(0, 1, 37 * 300, dtype=np.float32).reshape(37, 300)
    terrain = Heightfield(np.full((37, 300), 5.0), 10.0, layers={"mask_rain": mask})
    for device in ("numpy", None):
        place = f.Place(terrain.grid, Run(1, device), terrain)
        (values,) = place.computed(place.layer() + place.layer("mask_rain") * 2.0)
        got = values if isinstance(values, np.ndarray) else values.download()
        assert np.array_equal(got, np.float32(5.0) + mask * np.float32(2.0))


def test_another_setting_needs_no_other_kernel() -> None:
    def source(count: int, wavelength: float, seed: int) -> str:
        place = f.Place(GRID, Run(seed))
        sums = place.octaves("gradient", wavelength, count, place.words("t", seed))
        return _Kernel(Plan([f.fbm(sums) * wavelength])).source()

    assert source(5, 500.0, 1) == source(12, 77.0, 2)


def test_octaves_below_the_spacing_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"octaves = 24: octave \d+ has a wavelength"):
        both(lambda p: f.fbm(p.octaves("gradient", 1e-3, 24, (1, 2), lacunarity=4.0)))


def test_a_long_sum_does_not_exhaust_the_stack() -> None:
    def make(place: f.Place) -> f.Formula:
        total = place.x * 0.0
        for term in range(300):
            total = total + float(term)
        return total

    assert (both(make) == 300 * 299 / 2).all()


def test_samples_between_samples_are_splines() -> None:
    """Catmull-Rom keeps quadratics, and whole steps move by whole samples, bit for bit."""
    row, col = np.mgrid[0:20, 0:300].astype(np.float64)
    terrain = Heightfield(0.01 * col**2 - 0.3 * row * col + 5.0, 10.0)

    def at(east: float, north: float) -> list[Field]:
        made = []
        for device in ("numpy", None):
            place = f.Place(terrain.grid, Run(1, device), terrain).displaced(east, north)
            (values,) = place.computed(place.layer())
            made.append(values if isinstance(values, np.ndarray) else values.download())
        assert np.array_equal(made[0].view(np.int32), made[1].view(np.int32))
        return made

    whole = at(30.0, -20.0)[0]
    assert np.array_equal(whole[:-2, :-3], terrain.elevation[2:, 3:])
    assert (whole[:, -3:] == whole[:, -1:]).all()
    between = at(4.0, 7.0)[0]
    x, y = col + 0.4, row - 0.7
    expected = 0.01 * x**2 - 0.3 * y * x + 5.0
    assert np.abs(between - expected)[3:-3, 3:-3].max() < 1e-2
    for far in (1e30, -1e30, math.inf):
        assert np.isfinite(at(far, far)[0]).all()


@pytest.mark.parametrize("size", [1, 7, 64, 256])
def test_work_groups_do_not_matter(size: int) -> None:
    def make(place: f.Place) -> f.Formula:
        bent = place.displaced(f.fbm(octaves(place, "bend")) * 90.0, 0.0)
        return f.swiss(octaves(bent), 0.2) * f.sine(bent.x * X) + place.y

    usual = computed(make, None)
    place = f.Place(GRID, Run(3, work_group=size))
    (values,) = place.computed(make(place))
    assert np.array_equal(usual.view(np.int32), values.download().view(np.int32))


def test_no_hash_decides_the_source() -> None:
    """Neither the order of sets nor addresses show in what is compiled."""
    script = (
        "import hashlib\n"
        "from terrakit import Grid, Run\n"
        "from terrakit import formula as f\n"
        "from terrakit.formula.opencl import _Kernel\n"
        "from terrakit.formula.plan import Plan\n"
        "p = f.Place(Grid((9, 9), 10.0), Run(3, 'numpy'))\n"
        "o = lambda s: p.octaves('gradient', 500.0, 5, p.words(s, 1))\n"
        "a = f.swiss(o('a'), 0.2) * f.sine(p.x) + f.fbm(o('b')) * f.jordan(o('c'), 0.4, 1.0)\n"
        "print(hashlib.sha256(_Kernel(Plan([a, a * p.y])).source().encode()).hexdigest())\n"
    )
    said = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
            text=True,
        ).stdout
        for seed in ("0", "1", "77")
    }
    assert len(said) == 1


def test_far_from_the_origin_spacing_still_only_samples() -> None:
    """A place of a map in UTM coordinates is as high, however far apart its samples are."""
    heights = []
    for refined in (1, 2, 4):
        grid = Grid((8 * refined, 8 * refined), 1.0 / refined, (5e5, 5e6))
        values = both(lambda p: f.fbm(p.octaves("gradient", 20000.0, 3, (1, 2))), grid)
        heights.append(values[::refined, ::refined])
    assert np.abs(heights[0] - heights[1]).max() < 1e-6
    assert np.abs(heights[0] - heights[2]).max() < 1e-6


def test_octaves_are_summed_once() -> None:
    place = f.Place(GRID, Run(3))
    sums = octaves(place)
    f.fbm(sums)
    with pytest.raises(ValueError, match="summed already"):
        f.billow(sums)


def test_samples_do_not_depend_on_the_tile() -> None:
    field = np.random.default_rng(1).normal(size=(8, 4100)).astype(np.float32)

    def moved(part: slice) -> Field:
        terrain = Heightfield(field[:, part], 10.0)
        place = f.Place(terrain.grid, Run(1), terrain).displaced(73.1, -8.3)
        (values,) = place.computed(place.layer())
        return values.download() if hasattr(values, "download") else values

    assert np.array_equal(moved(slice(4000, 4100))[:, 10:80], moved(slice(0, 4100))[:, 4010:4080])


def test_a_displaced_mask_stays_within_its_parameter() -> None:
    from terrakit_generators.fractals.fbm import Fbm

    steps = Heightfield(np.repeat([[0.0, 1.0] * 32], 64, axis=0), 10.0)
    place = f.Place(steps.grid, Run(1, "numpy", earlier={"steps": steps})).displaced(3.0, 0.0)
    with place.run.watching(steps.grid):
        (values,) = place.computed(place.value(Fbm(amplitude="steps"), "amplitude"))
    assert values.min() >= 0.0
