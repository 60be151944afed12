"""Spectral synthesis: exactly as rough as it says, and a function of the place alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run
from terrakit_generators.spectral import Spectral

Heights = NDArray[np.float64]


def made(
    shape: tuple[int, int] = (256, 256),
    spacing: float = 10.0,
    origin: tuple[float, float] = (0.0, 0.0),
    run_seed: Any = 1,
    device: str | None = None,
    **settings: Any,
) -> Heights:
    settings = {"period": 2560.0, **settings}
    terrain = Spectral(**settings).generate(Grid(shape, spacing, origin), Run(run_seed, device))
    return terrain.elevation.astype(np.float64)


def power(height: Heights) -> tuple[Heights, Heights]:
    """Return wave number and power of every wave of one period."""
    size = len(height)
    k = np.fft.fftfreq(size, 1 / size)
    return np.hypot(k[:, None], k[None]).ravel(), (np.abs(np.fft.fft2(height)) ** 2).ravel()


@pytest.mark.parametrize("hurst", [0.0, 0.3, 0.6, 0.85, 1.0])
def test_spectrum_falls_as_the_hurst_exponent_says(hurst: float) -> None:
    k, energy = power(made(hurst_exponent=hurst))
    inside = (k >= 1) & (k < 120)
    slope, _ = np.polyfit(np.log(k[inside]), np.log(energy[inside]), 1)
    assert slope == pytest.approx(-(2 * hurst + 2), abs=0.01)
    # A power law to the last wave, not only in the mean
    scatter = energy[inside] * k[inside] ** (2 * hurst + 2)
    assert scatter.std() < 0.02 * scatter.mean()
    assert energy[k > 128].max() < 1e-6 * energy[inside].max()


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.7])
def test_variogram_follows_the_hurst_exponent(hurst: float) -> None:
    # Lags well above the last wave and well below the period
    slopes = []
    for seed in range(3):
        z = made((512, 512), 10.0, run_seed=seed, period=5120.0 * 2, hurst_exponent=hurst)
        lags = (6, 8, 12, 16, 24)
        means = [
            ((z[k:] - z[:-k]) ** 2).mean() + ((z[:, k:] - z[:, :-k]) ** 2).mean() for k in lags
        ]
        slopes.append(0.5 * np.polyfit(np.log(lags), np.log(means), 1)[0])
    assert float(np.mean(slopes)) == pytest.approx(hurst, abs=0.05)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"hurst_exponent": 0.5},
        {"longest_wavelength": 500.0, "shortest_wavelength": 40.0},
        {"stretch": 2.0, "direction": 40.0},
    ],
)
def test_amplitude_is_the_deviation(settings: dict[str, Any]) -> None:
    z = made(amplitude=80.0, offset=1000.0, **settings)
    assert z.std() == pytest.approx(80.0, rel=0.01)
    assert z.mean() == pytest.approx(1000.0, abs=0.01)


def test_heights_have_the_bell_curve_of_chance() -> None:
    heights = np.concatenate([made((64, 64), 40.0, run_seed=s).ravel() for s in range(40)]) / 300.0
    assert abs((heights**3).mean()) < 0.25
    assert (heights**4).mean() == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize("device", ["numpy", None])
@pytest.mark.parametrize("origin", [(0.0, 0.0), (1e6, -3e6), (123.4, 567.8)])
def test_tile_equals_whole(device: str | None, origin: tuple[float, float]) -> None:
    spacing = 7.3
    whole = made((40, 60), spacing, origin, device=device)
    place = (origin[0] + 21 * spacing, origin[1] - 13 * spacing)
    tile = made((17, 30), spacing, place, device=device)
    assert tile.tobytes() == whole[13:30, 21:51].tobytes()


def test_ground_repeats_after_the_period() -> None:
    here, there = made((40, 50)), made((40, 50), origin=(2560.0 * 3, -2560.0))
    assert np.array_equal(here, there)
    seam = made((257, 257))
    assert np.array_equal(seam[0], seam[-1])
    assert np.array_equal(seam[:, 0], seam[:, -1])


def test_half_the_spacing_only_adds_shorter_waves() -> None:
    coarse, fine = made((128, 128), 20.0), made((256, 256), 10.0)
    spectra = []
    for z in (coarse, fine):
        wave = np.fft.fft2(z) / z.size
        spectra.append(np.array([wave[j, i] for j in range(-40, 41) for i in range(-40, 41)]))
    assert np.abs(spectra[0] - spectra[1]).max() < 1e-4
    cut = {"shortest_wavelength": 60.0}
    same = made((128, 128), 20.0, **cut), made((256, 256), 10.0, **cut)
    assert np.abs(same[0] - same[1][::2, ::2]).max() < 2e-3


def test_cuts_leave_only_the_waves_between() -> None:
    k, energy = power(made(longest_wavelength=256.0, shortest_wavelength=64.0))
    inside = (k >= 10) & (k <= 40)
    assert energy[inside].min() > 1e3 * energy[~inside].max()


@pytest.mark.parametrize(
    ("direction", "axis"),
    [(0.0, (0.0, 1.0)), (90.0, (1.0, 0.0)), (45.0, (0.7071, 0.7071)), (-30.0, (-0.5, 0.866))],
)
def test_stretched_hills_point_where_they_are_told(
    direction: float, axis: tuple[float, float]
) -> None:
    z = made(stretch=4.0, direction=direction, longest_wavelength=600.0, shortest_wavelength=100.0)
    north, east = np.gradient(z)
    north = -north  # row 0 is north
    tensor = np.array(
        [[(east**2).mean(), (east * north).mean()], [(east * north).mean(), (north**2).mean()]]
    )
    values, vectors = np.linalg.eigh(tensor)
    assert abs(vectors[:, 0] @ np.array(axis)) > 0.99  # the least change is along the hills
    # rms slopes across and along differ by the stretch
    assert np.sqrt(values[1] / values[0]) == pytest.approx(4.0, rel=0.25)


def test_devices_agree_to_the_bit() -> None:
    for settings in ({}, {"stretch": 3.0, "direction": 77.0}, {"period": 300.0, "offset": 12.5}):
        for shape in ((1, 1), (37, 50), (129, 3)):
            ours, theirs = (
                made(shape, 7.7, (5e5, 1e6), device=d, **settings) for d in (None, "numpy")
            )
            assert ours.tobytes() == theirs.tobytes()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"longest_wavelength": 5.0}, "longest_wavelength = 5: must be at least 1/256 of period"),
        (
            {"shortest_wavelength": 900.0, "longest_wavelength": 300.0},
            "must not exceed the longest",
        ),
        (
            {"shortest_wavelength": 2000.0, "longest_wavelength": 2100.0},
            "no wave .* widen the band",
        ),
    ],
)
def test_bands_without_waves_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        made(**settings)
