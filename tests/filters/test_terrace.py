"""Benches are level, rise in order, and leave the height of the land as it was."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import crop, rough_terrain
from terrakit_filters.terrace import Terrace

Numbers = NDArray[np.float64]
RAMP = Heightfield(np.tile(np.linspace(-500.0, 500.0, 10001), (2, 1)), 1.0)
EVEN = {"variation": 0.0, "undulation": 0.0}


def terraced(
    terrain: Heightfield = RAMP, device: str | None = "numpy", **settings: object
) -> Numbers:
    operator = Terrace(**{"bench_height": 50.0} | settings)
    return np.asarray(execute(operator, terrain, Run(2, device)).elevation, dtype=np.float64)


def treads(z: Numbers) -> tuple[Numbers, Numbers]:
    """Return the heights of exactly level stretches and how much of the ramp each takes."""
    heights, counts = np.unique(z, return_counts=True)
    is_tread = counts > 20
    return heights[is_tread], counts[is_tread] / z.size


def test_even_benches_are_level_and_evenly_spaced() -> None:
    heights, shares = treads(terraced(sharpness=1.0, **EVEN)[0])
    assert heights == pytest.approx(np.arange(-500.0, 501.0, 50.0), abs=1e-3)
    assert shares.sum() == pytest.approx(0.88, abs=0.01)  # risers take 0.12


def test_uneven_benches_have_other_heights_each() -> None:
    heights, _ = treads(terraced(sharpness=1.0, variation=1.0, undulation=0.0)[0])
    thickness = np.diff(heights)
    assert 5.0 - 1e-3 <= thickness.min() < 30.0  # a tenth of a bench at least
    assert 70.0 < thickness.max() <= 95.0 + 1e-3
    assert thickness.mean() == pytest.approx(50.0, rel=0.1)
    assert len(np.unique(np.round(thickness, 1))) > 10


@pytest.mark.parametrize("variation", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("sharpness", [0.2, 0.85, 1.0])
def test_it_rises_with_the_ground_and_stays_within_a_bench(
    variation: float, sharpness: float
) -> None:
    z = terraced(sharpness=sharpness, variation=variation, undulation=0.0)[0]
    ramp = RAMP.elevation[0].astype(np.float64)
    assert (np.diff(z) >= -2e-4).all()
    assert np.abs(z - ramp).max() <= 0.5 * 50.0 * (1 + 0.9 * variation) * sharpness + 1e-3
    assert np.abs(np.diff(z)).max() < 0.1 * (1 + 1.875 / 0.12) * 1.01  # steep, but no jump
    if sharpness < 1:
        assert (np.diff(z[::4]) > 0).all()


def test_the_mean_height_of_a_long_slope_stays() -> None:
    for settings in (EVEN, {"variation": 1.0, "undulation": 30.0}):
        z = terraced(sharpness=1.0, **settings)
        assert z.mean() == pytest.approx(RAMP.elevation.mean(dtype=float), abs=2.5)


def test_offset_moves_the_edges() -> None:
    at_zero = terraced(sharpness=1.0, **EVEN)
    moved = terraced(
        RAMP.with_layers(elevation=RAMP.elevation + 13.0), offset=13.0, sharpness=1.0, **EVEN
    )
    assert moved == pytest.approx(at_zero + 13.0, abs=2e-3)


def test_strata_lie_unevenly_across_the_land() -> None:
    flat = Heightfield(np.full((101, 101), 10.0), 20.0)
    heights = terraced(flat, sharpness=1.0, undulation=30.0, wavelength=500.0)
    assert np.ptp(heights) > 15.0
    assert np.abs(heights - 10.0).max() < 50.0


def test_share_zero_leaves_the_ground() -> None:
    ground = rough_terrain((33, 47), relief=300.0)
    mask = np.zeros(ground.shape, np.float32)
    mask[:, 20:] = 1.0
    masked = terraced(ground.with_layers(mask_here=mask), share="mask_here")
    assert np.array_equal(masked[:, :20], ground.elevation[:, :20])
    assert np.array_equal(masked[:, 20:], terraced(ground)[:, 20:])


def test_a_tile_is_a_part_of_the_whole() -> None:
    ground = rough_terrain((65, 65), relief=300.0, origin=(123456.7, -89.1))
    tile = crop(ground, 11, 20, 30, 25)
    assert np.array_equal(terraced(tile), terraced(ground)[11:41, 20:45])


def test_devices_agree() -> None:
    ground = rough_terrain((65, 65), relief=300.0)
    assert np.array_equal(terraced(ground), terraced(ground, None))


def test_tiny_benches_under_huge_relief_stay_finite() -> None:
    high = Heightfield(np.linspace(-1e6, 1e6, 400).reshape(20, 20), 10.0)
    assert np.isfinite(terraced(high, bench_height=0.1, variation=1.0)).all()


def test_values_out_of_bounds_are_refused() -> None:
    with pytest.raises(ParameterError, match="bench_height"):
        Terrace(bench_height=0.0)
    with pytest.raises(ParameterError, match="sharpness"):
        Terrace(sharpness=1.5)
