"""Amplified land: what is there stays, and what is new is as rough as the land itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit.parameters import FromLayer
from terrakit.testing.subjects import crop, rough_terrain
from terrakit_filters.amplify import Amplify, measure, refined
from terrakit_filters.dequantise import Dequantise

Heights = NDArray[np.float64]
SPACING = 83.0


@pytest.fixture(scope="module")
def land() -> Heights:
    """The Jacksboro fault, Tennessee: whole metres at 3 arc seconds."""
    cbook = pytest.importorskip("matplotlib.cbook")
    path = Path(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))
    with np.load(path) as archive:
        heights: Heights = archive["elevation"][:343, :403].astype(np.float64)
    return heights


def held_out(land: Heights) -> Heightfield:
    """Return every second sample."""
    return Heightfield(land[::2, ::2], 2 * SPACING)


def amplified(terrain: Heightfield, device: Any = None, seed: int = 1, **settings: Any) -> Any:
    return execute(Amplify(**{"factor": 2, **settings}), terrain, Run(seed, device))


def variogram(z: Heights, lag: int) -> float:
    return float(((z[lag:] - z[:-lag]) ** 2).mean() + ((z[:, lag:] - z[:, :-lag]) ** 2).mean())


def slopes(z: Heights) -> Heights:
    """Return the slope of every cell, degrees."""
    x = (z[:-1, 1:] - z[:-1, :-1] + z[1:, 1:] - z[1:, :-1]) / (2 * SPACING)
    y = (z[1:, :-1] - z[:-1, :-1] + z[1:, 1:] - z[:-1, 1:]) / (2 * SPACING)
    angle: Heights = np.degrees(np.arctan(np.hypot(x, y)))
    return angle


def distance(a: Heights, b: Heights) -> float:
    """Return Kolmogorov and Smirnov's distance of two samples."""
    from scipy.stats import ks_2samp

    return float(ks_2samp(a.ravel(), b.ravel()).statistic)


def test_samples_are_kept_bit_for_bit(land: Heights) -> None:
    terrain = held_out(land[:201, :161])
    for factor in (2, 8):
        fine = amplified(terrain, factor=factor)
        assert fine.shape == tuple((n - 1) * factor + 1 for n in terrain.shape)
        assert fine.spacing == terrain.spacing / factor
        assert fine.origin == terrain.origin
        kept = np.ascontiguousarray(fine.elevation[::factor, ::factor])
        assert kept.tobytes() == terrain.elevation.tobytes()


def test_held_out_land_comes_back_as_rough_as_it_was(land: Heights) -> None:
    terrain = held_out(land)
    for seed in (1, 2):
        fine = amplified(terrain, seed=seed).elevation.astype(np.float64)
        assert variogram(fine, 1) == pytest.approx(variogram(land, 1), rel=0.15)
        assert distance(fine, land) < 0.01  # hypsometry
        missed = (fine - land)[1::2, 1::2]
        assert 5.0 < missed.std() < 15.0  # new heights are made up, but of the right size


def test_slopes_are_truer_than_bicubic_ones_and_those_of_the_published_stencil(
    land: Heights,
) -> None:
    from scipy.ndimage import zoom

    terrain = held_out(land)
    scale = [a / b for a, b in zip(land.shape, terrain.shape, strict=True)]
    bicubic = zoom(terrain.elevation.astype(np.float64), scale, order=3)
    gaps = {
        "bicubic": distance(slopes(bicubic), slopes(land)),
        **{
            name: distance(slopes(amplified(terrain, **kw).elevation.astype(float)), slopes(land))
            for name, kw in (("amplify", {}), ("mean", {"stencil": "mean"}))
        },
    }
    assert gaps["amplify"] < 0.8 * gaps["bicubic"]
    assert gaps["amplify"] < 0.6 * gaps["mean"]


def test_measuring_a_fractal_finds_its_exponent() -> None:
    random = np.random.default_rng(3)
    n, exponent = 1600, 0.6
    k = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None, :])
    k[0, 0] = np.inf
    phase = np.fft.rfft2(random.normal(size=(n, n)))
    z = np.fft.irfft2(phase * k ** -(1 + exponent), (n, n))[::4, ::4]  # no shortest wave
    found = measure(Heightfield(1000 * z / z.std(), 10.0))
    assert found.hurst_exponent == pytest.approx(exponent, abs=0.1)
    assert found.falloff_diamond == pytest.approx(exponent, abs=0.1)
    assert found.falloff_square == pytest.approx(exponent, abs=0.1)
    # A half-step is sqrt 2
    assert found.sigma_square / found.sigma_diamond == pytest.approx(2 ** (-exponent / 2), abs=0.05)
    centre, edge = found.deviations(1)
    assert centre == pytest.approx(found.sigma_diamond * 4**-found.falloff_diamond, rel=1e-5)
    assert edge == pytest.approx(found.sigma_square * 4**-found.falloff_square, rel=1e-5)


def test_paraboloids_hold_no_surprise() -> None:
    row, col = np.indices((25, 31), dtype=np.float64)
    bowl = Heightfield(2 * row**2 + col**2 - 3 * row * col + 5 * col, 16.0)
    assert measure(bowl).sigma_diamond < 1e-9
    fine = amplified(bowl, factor=4, detail=1.0).elevation
    row, col = (i / 4 for i in np.indices(fine.shape))
    expected = 2 * row**2 + col**2 - 3 * row * col + 5 * col
    inner = slice(24, -24)
    assert np.abs(fine - expected)[inner, inner].max() < 1e-2


@pytest.mark.parametrize("height", [0.0, 1234.56, -8000.1])
def test_level_ground_stays_level(height: float) -> None:
    flat = Heightfield(np.full((12, 14), height), 5.0)
    assert measure(flat).is_flat
    assert np.unique(amplified(flat, factor=4).elevation).size == 1


def test_lakes_stay_flat_and_shores_do_not(land: Heights) -> None:
    z = land[:160, :160].copy()
    level = float(np.quantile(z, 0.3))
    lake = Heightfield(np.maximum(z, level), SPACING)
    fine = amplified(lake, factor=4).elevation
    wet = z < level
    inside = wet[:-1, :-1] & wet[:-1, 1:] & wet[1:, :-1] & wet[1:, 1:]
    blocks = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, :-1] & inside[1:, 1:]
    row, col = np.argwhere(blocks).T
    assert len(row) > 500
    for south in range(0, 9):
        for east in range(0, 9):
            assert (fine[4 * row + south, 4 * col + east] == np.float32(level)).all()
    assert np.abs(fine[::2, ::2] - amplified(lake, detail=0.0).elevation).max() > 2.0


def test_water_and_filled_ground_get_no_detail(land: Heights) -> None:
    z = land[:90, :90]
    for name, wrong, right in (("water_depth", 3.0, 0.0), ("valid", 0.0, 1.0)):
        layer = np.full(z.shape, right, dtype=np.float32)
        layer[20:60, 30:70] = wrong
        terrain = Heightfield(z, SPACING).with_layers(**{name: layer})
        first, second = (amplified(terrain, seed=seed) for seed in (1, 2))
        change = np.abs(first.elevation - second.elevation)
        assert change[40:119, 60:139].max() == 0.0
        assert change[:38].max() > 1.0
        plain = 0.5 * (z[20:60, 30:69] + z[20:60, 31:70])
        assert np.allclose(first.elevation[40:119:2, 61:139:2], plain, atol=1e-3)
        assert set(np.unique(first.layer("valid"))) == {0, 1} if name == "valid" else True
        other = measure(Heightfield(z, SPACING).with_layers(**{name: layer}))
        ruined = z.copy()
        ruined[22:58, 32:68] = 500.0
        told = measure(Heightfield(ruined, SPACING).with_layers(**{name: layer}))
        assert told.sigma_diamond == other.sigma_diamond


def test_rugged_ground_gets_more_detail_than_smooth() -> None:
    row, col = np.indices((60, 120))
    hills = 40 * np.sin(row / 9) + 30 * np.cos(col / 11)
    grain = np.random.default_rng(1).normal(size=hills.shape) * np.where(col < 60, 0.2, 4.0)
    terrain = Heightfield(hills + grain, 10.0)
    detail = amplified(terrain).elevation - amplified(terrain, detail=0.0).elevation
    west, east = detail[:, :100].std(), detail[:, 140:].std()
    assert 10 < east / west < 30
    even = amplified(terrain, modulation=False).elevation
    even = even - amplified(terrain, detail=0.0).elevation
    assert even[:, :100].std() == pytest.approx(even[:, 140:].std(), rel=0.1)


def test_where_and_detail_scale_the_detail() -> None:
    terrain = rough_terrain((33, 41))
    mask = np.zeros(terrain.shape, dtype=np.float32)
    mask[:, 20:] = 1.0
    terrain = terrain.with_layers(mask_east=mask)
    smooth = amplified(terrain, detail=0.0).elevation.astype(np.float64)
    full = amplified(terrain).elevation - smooth
    half = amplified(terrain, detail=0.5).elevation - smooth
    assert np.allclose(half, 0.5 * full, atol=1e-3)
    east = amplified(terrain, where="mask_east").elevation - smooth
    assert not east[:, :35].any()
    # A guess reaches three finer samples, and its centres three more
    assert np.array_equal(east[:, 44:], full[:, 44:])
    scaled = FromLayer(layer="mask_east", low=1.0, high=1.0)
    assert np.array_equal(amplified(terrain, where=scaled).elevation - smooth, full)


@pytest.mark.parametrize("settings", [{}, {"stencil": "mean"}, {"factor": 8, "seed": "other"}])
def test_reference_and_device_agree(settings: dict[str, Any], land: Heights) -> None:
    terrain = Heightfield(land[50:90, 70:121], SPACING, (4e5, 4e6))
    results = [amplified(terrain, device, **settings).elevation for device in (None, "numpy")]
    assert results[0].tobytes() == results[1].tobytes()


def test_overlapping_tiles_agree_given_the_same_measure(land: Heights) -> None:
    world = Heightfield(land[:80, :90], SPACING, (1e5, 2e5))
    operator, run = Amplify(factor=4, modulation=False), Run(4)
    found = operator.measured(world)
    whole = refined(operator, world, found, run).elevation
    part = refined(operator, crop(world, 21, 30, 40, 45), found, run).elevation
    inner = part[24:-24, 24:-24]
    assert inner.tobytes() == np.ascontiguousarray(whole[84:241, 120:297][24:-24, 24:-24]).tobytes()


def test_layers_come_along(land: Heights) -> None:
    terrain = Heightfield(land[:40, :50], SPACING)
    ramp = np.tile(np.linspace(0, 1, 50, dtype=np.float32), (40, 1))
    plate = (np.indices(terrain.shape)[1] > 20).astype(np.float32)
    fine = amplified(terrain.with_layers(mask_a=ramp, plate=plate), factor=4)
    assert np.allclose(fine.layer("mask_a"), np.linspace(0, 1, 197), atol=1e-6)
    assert fine.layer("mask_a").min() == 0.0
    assert fine.layer("mask_a").max() == 1.0
    assert set(np.unique(fine.layer("plate"))) == {0.0, 1.0}


def test_eight_bits_are_refined_without_terraces_once_dequantised(land: Heights) -> None:
    step = np.ptp(land) / 40
    terrain = Heightfield(np.round(land / step) * step, SPACING)

    def level_share(z: NDArray[np.float32]) -> float:
        return float((slopes(z.astype(np.float64)) < 0.3).mean())

    plain = amplified(terrain, detail=0.0).elevation
    smoothed = execute(Dequantise(), terrain, Run(1))
    better = amplified(smoothed, detail=0.0).elevation
    assert level_share(plain) > 0.08
    assert level_share(better) < 0.15 * level_share(plain)


def test_spacing_in_metres_goes_before_the_factor(land: Heights) -> None:
    terrain = Heightfield(land[:20, :20], SPACING)
    assert amplified(terrain, spacing=30.0).spacing == SPACING / 4
    assert amplified(terrain, spacing=SPACING / 2).spacing == SPACING / 2
    assert amplified(terrain, spacing=100.0) is terrain


def test_refusals_say_the_way_out() -> None:
    with pytest.raises(ParameterError, match="power of two"):
        Amplify(factor=3)
    with pytest.raises(ParameterError, match="at most 64"):
        amplified(rough_terrain(), spacing=0.01)
    with pytest.raises(InputError, match="at least 9x9"):
        amplified(rough_terrain((8, 40)))
