"""Finer passes through the samples, coarser folds nothing in, planes stay planes."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, InputError, ParameterError, Run
from terrakit.testing.subjects import compass_terrain, rough_terrain
from terrakit_filters.resample import Resample


@pytest.mark.parametrize("spacing", [1.7, 2.5, 5.0, 10.0, 13.0, 20.0, 47.0])
@pytest.mark.parametrize("method", ["smooth", "pick"])
def test_planes_stay_planes_up_to_the_edge(spacing: float, method: str) -> None:
    def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 3.0 + 0.25 * (x - 700.0) - 0.5 * (y - 900.0)

    x, y = 700 + np.arange(41) * 10.0, 900 - np.arange(31) * 10.0
    start = Heightfield(plane(x[None], y[:, None]), 10.0, (700.0, 900.0))
    result = Resample(spacing=spacing, method=method)(start)
    rows, cols = result.shape
    assert (rows, cols) == (int(300 / spacing + 1e-9) + 1, int(400 / spacing + 1e-9) + 1)
    assert result.origin == (700.0, 900.0)
    x, y = 700 + np.arange(cols) * spacing, 900 - np.arange(rows) * spacing
    assert np.abs(result.elevation - plane(x[None], y[:, None])).max() < 2e-5


@pytest.mark.parametrize("times", [2, 3, 5])
def test_shared_samples_keep_their_bits(times: int) -> None:
    start = rough_terrain((21, 33), 9.0).with_layers(
        valid=np.random.default_rng(1).integers(0, 2, (21, 33)), hardness=np.full((21, 33), 0.3)
    )
    fine = Resample(spacing=9.0 / times)(start)
    assert fine.shape == (20 * times + 1, 32 * times + 1)
    for name in start:
        assert np.array_equal(fine.layer(name)[::times, ::times], start.layer(name)), name
    back = Resample(spacing=9.0, method="pick")(fine)
    assert np.array_equal(back.elevation, start.elevation)
    assert set(np.unique(fine.layer("valid"))) == {0.0, 1.0}


def test_the_same_spacing_changes_nothing() -> None:
    start = rough_terrain((21, 33), 9.0)
    assert np.array_equal(Resample(spacing=9.0)(start).elevation, start.elevation)


def test_smooth_ground_is_found_between_the_samples() -> None:
    def wave(n: int, spacing: float) -> np.ndarray:
        y, x = np.indices((n, n)) * spacing
        return 100 * np.sin(x / 60) * np.cos(y / 50)

    fine = Resample(spacing=2.5)(Heightfield(wave(41, 10.0), 10.0)).elevation
    assert np.abs(fine - wave(161, 2.5)).max() < 0.4  # linear: 0.6


def test_what_is_too_fine_to_show_is_averaged_away() -> None:
    x = np.arange(201) * 1.0
    ripple = np.tile(10.0 * np.sin(2 * np.pi * x / 3.3 + 1), (201, 1))
    start = Heightfield(ripple, 1.0)
    coarse = Resample(spacing=10.0)(start).elevation[2:-2, 2:-2]
    assert np.abs(coarse).max() < 0.4
    assert np.abs(Resample(spacing=10.0, method="pick")(start).elevation).max() > 9.0


@pytest.mark.parametrize("spot", [(40, 40), (41, 43), (47, 38)])
def test_volumes_are_kept_when_coarsening(spot: tuple[int, int]) -> None:
    height = np.zeros((81, 81))
    height[spot] = 100.0
    coarse = Resample(spacing=4.0)(Heightfield(height, 1.0)).elevation.astype(np.float64)
    assert coarse.sum() * 4.0**2 == pytest.approx(100.0, rel=1e-5)


def test_layers_stay_within_their_range() -> None:
    mask = np.random.default_rng(3).integers(0, 2, (50, 50)).astype(np.float32)
    for spacing in (3.0, 10.0, 27.0):
        result = Resample(spacing=spacing)(
            Heightfield(np.zeros((50, 50)), 10.0, layers={"mask_m": mask})
        ).layer("mask_m")
        assert 0.0 <= result.min() < result.max() <= 1.0


def test_corners_stay_corners() -> None:
    start = compass_terrain((9, 9), 10.0)
    fine = Resample(spacing=5.0)(start).elevation
    for row in (0, -1):
        for col in (0, -1):
            assert fine[row, col] == start.elevation[row, col]


def test_another_step_gives_the_samples() -> None:
    start = rough_terrain((41, 41), 10.0)
    like = Heightfield(np.zeros((17, 9)), 7.0, (30.0, 350.0))
    result = Resample(like="other", spacing=3.0)(start, Run(earlier={"other": like}))
    assert result.grid == like.grid
    near = start.elevation[round((start.origin[1] - 350.0) / 10.0), 3]
    assert result.elevation[0, 0] == near
    with pytest.raises(InputError, match="beyond this terrain; crop"):
        Resample(like="start")(like, Run(earlier={"start": start}))


def test_settings_that_make_no_grid_are_refused() -> None:
    start = rough_terrain((9, 9), 10.0)
    with pytest.raises(ParameterError, match="neither is given"):
        Resample()
    with pytest.raises(InputError, match="spacing = 90: leaves 1x1 samples"):
        Resample(spacing=90.0)(start)
    with pytest.raises(InputError, match="use a larger one"):
        Resample(spacing=1e-4)(start)
