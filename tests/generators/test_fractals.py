"""Fractals: as rough as they say, alike in all directions, without a lattice to be seen."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run, generate
from terrakit.analysis.scaling import spectral_slope
from terrakit.execute import execute
from terrakit.noise import BASES
from terrakit.registry import default_registry
from terrakit_generators.fractals.domain_warp import DomainWarp
from terrakit_generators.fractals.fbm import Fbm
from terrakit_generators.fractals.octaves import Basis, Fractal, SlopeBasis

Heights = NDArray[np.float64]


def made(size: int = 257, spacing: float = 10.0, seed: Any = 1, **settings: Any) -> Heights:
    terrain = generate("fbm", size, spacing, run=Run(seed), **settings)
    return terrain.elevation.astype(np.float64)


def variogram_slope(height: Heights, axis: int, lags: tuple[int, ...]) -> float:
    """Return the slope of log mean squared difference over log lag."""
    z = np.moveaxis(height, axis, 0)
    means = [((z[lag:] - z[:-lag]) ** 2).mean() for lag in lags]
    return float(np.polyfit(np.log(lags), np.log(means), 1)[0])


@pytest.mark.parametrize("hurst", [0.3, 0.6, 0.85])
def test_variogram_follows_the_hurst_exponent(hurst: float) -> None:
    slopes = [
        variogram_slope(
            made(513, 10.0, seed, hurst_exponent=hurst, octaves=14, wavelength=8000.0),
            axis,
            (4, 6, 8, 12, 16, 24),
        )
        for seed in range(3)
        for axis in (0, 1)
    ]
    # Finite octaves end in smooth ground, which raises the slope of jagged terrains most
    assert 0.5 * float(np.mean(slopes)) == pytest.approx(hurst, abs=0.12)


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_spectrum_falls_as_the_hurst_exponent_says(hurst: float) -> None:
    settings = {"hurst_exponent": hurst, "octaves": 14, "wavelength": 5000.0}
    slopes = [spectral_slope(made(513, 10.0, seed, **settings))[0] for seed in range(3)]
    assert float(np.mean(slopes)) == pytest.approx(2 + 2 * hurst, abs=0.1)


def test_directions_are_alike() -> None:
    along: list[Heights] = []
    for seed in range(8):
        z = made(257, 10.0, seed, wavelength=800.0)
        slant = (z[3:, 3:] - z[:-3, :-3], z[3:, :-3] - z[:-3, 3:])
        straight = (z[4:] - z[:-4], z[:, 4:] - z[:, :-4])  # 3 sqrt 2 is about 4
        along.append(np.array([(d**2).mean() for d in (*straight, *slant)]))
    energy = np.mean(along, axis=0)
    energy[2:] *= (4 / (3 * np.sqrt(2))) ** 1.7
    assert energy.max() / energy.min() < 1.35


def test_amplitude_is_never_exceeded() -> None:
    for seed in range(4):
        z = made(257, 40.0, seed, amplitude=100.0, offset=30.0, octaves=2)
        assert -70.0 <= z.min() < z.max() <= 130.0
        assert np.ptp(z) > 60.0


def test_lattice_points_are_not_flat() -> None:
    # With lacunarity 2 and no shifts, every octave of gradient noise is 0 at lattice points
    z = made(33, 1000.0, wavelength=1000.0, octaves=6, lacunarity=2.0, amplitude=1.0)
    assert (z != 0.0).all()
    assert z.std() > 0.1


def test_octaves_add_up_to_finer_detail() -> None:
    few, many = (made(129, 5.0, octaves=n) for n in (3, 10))
    rough = [np.abs(np.diff(z, 2, axis=0)).mean() for z in (few, many)]
    assert rough[1] > 3 * rough[0]


@pytest.mark.parametrize("device", ["numpy", None])
@pytest.mark.parametrize("origin", [(0.0, 0.0), (1e6, -3e6), (123.4, 567.8)])
def test_tile_equals_whole(device: str | None, origin: tuple[float, float]) -> None:
    spacing = 7.3
    operator, run = Fbm(), Run(5, device)
    whole = operator.generate(Grid((40, 60), spacing, origin), run).elevation
    place = (origin[0] + 21 * spacing, origin[1] - 13 * spacing)
    tile = operator.generate(Grid((17, 30), spacing, place), run).elevation
    assert tile.tobytes() == whole[13:30, 21:51].tobytes()


def test_spacing_only_samples_the_same_land() -> None:
    coarse, fine = made(33, 40.0, seed=2, octaves=5), made(129, 10.0, seed=2, octaves=5)
    assert np.abs(fine[::4, ::4] - coarse).max() < 0.01


def test_gain_goes_before_the_hurst_exponent() -> None:
    assert np.array_equal(made(33, gain=0.5), made(33, gain=0.5, hurst_exponent=0.1))
    assert not np.array_equal(made(33, gain=0.5), made(33))


def test_octaves_far_below_the_spacing_are_refused() -> None:
    with pytest.raises(ParameterError, match="use fewer"):
        made(9, 1e4, wavelength=1e5, octaves=24, lacunarity=4.0)
    with pytest.raises(ParameterError, match="wavelength = 1 m: .* use a longer one"):
        made(9, 1e8, wavelength=1.0)


METRICS = ("manhattan", "chebyshev", "squared", "half")
FRACTALS = [k for k in default_registry().operators("generator") if issubclass(k, Fractal)]


def test_every_basis_can_be_chosen() -> None:
    plain = {name for name in BASES if "_" not in name or name.startswith("cellular")}
    assert set(get_args(Basis)) <= set(BASES)
    assert {n for n in plain if not n.endswith(METRICS)} == set(get_args(Basis))
    assert set(get_args(SlopeBasis)) == {n for n in BASES if BASES[n].has_slope}


@pytest.mark.parametrize("basis", get_args(Basis))
def test_every_basis_makes_ground_within_its_amplitude(basis: str) -> None:
    z = made(129, 40.0, basis=basis, amplitude=100.0, octaves=3, wavelength=1000.0)
    assert np.abs(z).max() <= 101.0
    assert z.std() > 3.0


@pytest.mark.parametrize("kind", FRACTALS, ids=[kind.name for kind in FRACTALS])
def test_heights_are_where_the_readme_says(kind: type[Fractal]) -> None:
    z = np.stack([made_by(kind, seed, amplitude=100.0, offset=1000.0) for seed in range(4)]) - 1000
    both_sides = {"fbm", "billow", "variable_lacunarity", "slope_damped"}
    products = {"hybrid_multifractal", "heterogeneous_terrain", "multifractal"}
    if kind.name in both_sides:
        assert -100.0 <= z.min() < -20.0
        assert 20.0 < z.max() <= 100.0
        # Below and above, about alike: billow's cushions stand mostly low
        assert abs(z.mean()) < 60.0
    elif kind.name in products:
        assert 0.05 * 100.0 < z.mean() < 100.0
        assert z.max() < 400.0
    else:
        assert z.min() >= -1e-3
        assert 30.0 < z.max() <= 100.0 + 1e-3


def made_by(kind: type[Fractal], seed: int, **settings: Any) -> Heights:
    return made_named(kind.name, seed, **settings)


def made_named(name: str, seed: int, **settings: Any) -> Heights:
    terrain = generate(name, 129, 60.0, run=Run(seed), wavelength=2000.0, **settings)
    return terrain.elevation.astype(np.float64)


@pytest.mark.parametrize("kind", FRACTALS, ids=[kind.name for kind in FRACTALS])
def test_no_direction_is_preferred(kind: type[Fractal]) -> None:
    """Squared differences over equal distances, along the axes and the diagonals."""
    straight, slant = 0.0, 0.0
    for seed in range(6):
        terrain = generate(kind.name, 257, 10.0, run=Run(seed), wavelength=400.0, octaves=3)
        z = terrain.elevation.astype(np.float64)
        straight += ((z[7:] - z[:-7]) ** 2).mean() + ((z[:, 7:] - z[:, :-7]) ** 2).mean()
        slant += ((z[5:, 5:] - z[:-5, :-5]) ** 2).mean() + ((z[5:, :-5] - z[:-5, 5:]) ** 2).mean()
    # 5 sqrt 2 is 7.07; noise of this roughness grows with the square or less
    assert slant / straight == pytest.approx((5 * np.sqrt(2) / 7) ** 1.5, rel=0.12)


def test_multifractals_are_rougher_where_they_are_high() -> None:
    for name in ("heterogeneous_terrain", "hybrid_multifractal", "ridged_multifractal"):
        z = made_named(name, 3, octaves=8)
        rough = np.abs(z[1:-1, 2:] + z[1:-1, :-2] + z[2:, 1:-1] + z[:-2, 1:-1] - 4 * z[1:-1, 1:-1])
        high = z[1:-1, 1:-1] > np.quantile(z, 0.75)
        low = z[1:-1, 1:-1] < np.quantile(z, 0.25)
        assert rough[high].mean() > 1.3 * rough[low].mean(), name


def test_ridges_are_sharp_and_valleys_are_not() -> None:
    z = made_named("ridged_multifractal", 1, octaves=1)
    bend = z[1:-1, 2:] + z[1:-1, :-2] + z[2:, 1:-1] + z[:-2, 1:-1] - 4 * z[1:-1, 1:-1]
    assert -bend.min() > 4 * bend.max()


def test_damping_smooths_slopes() -> None:
    def detail(damping: float) -> float:
        z = made_named("slope_damped", 5, octaves=8, damping=damping)
        steep = np.hypot(*np.gradient(z))
        return float(np.abs(np.diff(z, 2, axis=0))[:, :][steep[1:-1] > np.median(steep)].mean())

    assert detail(4.0) < 0.7 * detail(0.0)


def test_warp_of_nothing_is_the_source_bit_for_bit() -> None:
    grid = Grid((65, 65), 50.0)
    for device in ("numpy", None):
        run = Run(4, device)
        still = DomainWarp(source=Fbm(octaves=4), strength=0.0).generate(grid, run).elevation
        assert np.array_equal(still, Fbm(octaves=4).generate(grid, run).elevation)


def test_warps_nest() -> None:
    grid = Grid((33, 65), 50.0)
    inner = DomainWarp(source=Fbm(octaves=4), strength=300.0, nesting=2, seed=1)
    outer = DomainWarp(source=inner, strength=200.0, nesting=3, seed=2)
    reference, ours = (outer.generate(grid, Run(4, d)).elevation for d in ("numpy", None))
    assert np.array_equal(reference, ours)
    assert not np.array_equal(ours, inner.generate(grid, Run(4)).elevation)


def test_warp_moves_no_place_farther_than_its_strength() -> None:
    """A cone's slope turns metres of displacement into metres of height."""
    grid = Grid((65, 65), 50.0)
    ramp = {"use": "expression", "formula": "0.5 * x", "center": [0.0, 0.0]}
    warped = DomainWarp(source=ramp, strength=100.0).generate(grid, Run(4)).elevation
    moved = (warped - 0.5 * 50.0 * np.arange(65)[None, :]) / 0.5
    assert 30.0 < np.abs(moved).max() <= 100.0


def test_samples_are_warped_like_the_formula_that_they_are_of() -> None:
    grid = Grid((129, 129), 20.0)
    hills = Fbm(octaves=3, wavelength=1500.0)
    for device in ("numpy", None):
        run = Run(4, device, earlier={"hills": execute(hills, grid, Run(4, device))})
        warp = {"strength": 400.0, "wavelength": 2000.0, "octaves": 2}
        exact = execute(DomainWarp(source=hills, **warp), grid, run).elevation
        sampled = execute(DomainWarp(source="hills", **warp), grid, run).elevation
        inside = slice(25, -25)
        assert np.abs(exact - sampled)[inside, inside].max() < 2.0
        assert np.abs(exact - sampled).max() > 20.0  # the border is repeated


def test_amplitude_follows_another_generator() -> None:
    grid = Grid((33, 33), 100.0)
    driven = Fbm(amplitude={"use": "fbm", "amplitude": 50.0, "offset": 60.0, "seed": 9}, octaves=3)
    flat = Fbm(amplitude=1.0, octaves=3)
    strength = Fbm(amplitude=50.0, offset=60.0, seed=9)
    made = [execute(kind, grid, Run(2)).elevation for kind in (driven, flat, strength)]
    assert np.allclose(made[0], made[1] * made[2], rtol=1e-5)
