"""Fractal noise: as rough as it says, alike in all directions, without a lattice to be seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run, generate
from terrakit_generators.fbm import Fbm

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
        made(9, 1e8, wavelength=1.0, octaves=24, lacunarity=4.0)
