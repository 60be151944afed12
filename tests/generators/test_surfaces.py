"""Surfaces of which mathematics knows volume, mean and extremes."""

from __future__ import annotations

import math
import typing

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Run
from terrakit.execute import execute
from terrakit_generators.surfaces import SHAPES, TUBE, SurfaceName, Surfaces

H, R = 120.0, 400.0
Heights = NDArray[np.float64]


def made(
    surface: str,
    samples: int = 513,
    extent: float = 4.0 * R,
    device: str = "numpy",
    **settings: object,
) -> Heights:
    """Return a surface about the middle of a square of ``extent`` metres."""
    grid = Grid((samples, samples), extent / (samples - 1), (-extent / 2, extent / 2))
    operator = Surfaces(
        **{"surface": surface, "amplitude": H, "radius": R, "center": [0.0, 0.0]} | settings
    )
    z: Heights = execute(operator, grid, Run(1, device)).elevation.astype(np.float64)
    return z


def volume(z: Heights, extent: float) -> float:
    return float(z.sum()) * (extent / (len(z) - 1)) ** 2


VOLUMES = {
    "paraboloid": math.pi * R**2 * H / 2,
    "cone": math.pi * R**2 * H / 3,
    "hemisphere": 2 * math.pi * R**2 * H / 3,
    "pyramid": (2 * R) ** 2 * H / 3,
    "torus_ring": math.pi**2 * R * (TUBE * R) * H,
}


@pytest.mark.parametrize("surface", VOLUMES)
def test_volume_of_what_has_an_edge(surface: str) -> None:
    extent = 2.6 * R
    assert volume(made(surface, 801, extent), extent) == pytest.approx(VOLUMES[surface], rel=1e-3)


def test_volume_of_what_fades() -> None:
    extent = 14.0 * R
    hill = made("gaussian_hill", 401, extent)
    assert volume(hill, extent) == pytest.approx(2 * math.pi * R**2 * H, rel=1e-3)
    hat = made("mexican_hat", 401, extent)
    assert abs(volume(hat, extent)) < 1e-3 * volume(np.abs(hat), extent)


def test_means_over_whole_waves() -> None:
    for surface, mean in (("sine_ridges", 0.0), ("eggcrate", 0.0), ("dune_train", 0.5 * H)):
        z = made(surface, 401, 1600.0, wavelength=400.0)[:-1, :-1]
        assert z.mean() == pytest.approx(mean, abs=1e-3 * H)


def test_saddles_are_saddles() -> None:
    for surface, ups in (("saddle", 2), ("monkey_saddle", 3)):
        z = made(surface, 257)
        middle = 128
        angle = np.linspace(0.0, 2 * math.pi, 360, endpoint=False)
        row = np.round(middle - 90 * np.sin(angle)).astype(int)
        col = np.round(middle + 90 * np.cos(angle)).astype(int)
        above = z[row, col] > z[middle, middle]
        assert int((above & ~np.roll(above, 1)).sum()) == ups
    z = made("saddle", 257)
    laplacian = z[:-2, 1:-1] + z[2:, 1:-1] + z[1:-1, :-2] + z[1:-1, 2:] - 4 * z[1:-1, 1:-1]
    assert np.abs(laplacian).max() < 1e-3  # harmonic


def test_peaks_are_those_of_matlab() -> None:
    x = np.linspace(-3.0, 3.0, 257)
    u, v = np.meshgrid(x, x[::-1])
    peaks = (
        3 * (1 - u) ** 2 * np.exp(-(u**2) - (v + 1) ** 2)
        - 10 * (u / 5 - u**3 - v**5) * np.exp(-(u**2) - v**2)
        - np.exp(-((u + 1) ** 2) - v**2) / 3
    )
    z = made("peaks", 257, 4.0 * R)
    assert z / H == pytest.approx(peaks / 8.106213589, abs=1e-5)
    assert z.max() == pytest.approx(H, rel=2e-3)


def test_ripple_is_smooth_through_its_middle() -> None:
    z = made("ripple", 1025, 40.0, wavelength=800.0)
    assert z.max() == pytest.approx(H, rel=1e-6)
    step = np.abs(np.diff(z, axis=1)).max()
    assert step < 1e-2
    y = made("ripple", 401, 3200.0, wavelength=800.0)[200]
    k = 2 * math.pi / 800.0
    x = np.linspace(-1600.0, 1600.0, 401)
    assert y == pytest.approx(H * np.sinc(k * x / math.pi), abs=1e-3)


def test_dunes_are_steep_in_the_lee() -> None:
    z = made("dune_train", 401, 1600.0, wavelength=400.0, direction=90.0)[0]
    slope = np.diff(z)
    assert -slope.min() > 2.5 * slope.max()
    assert np.abs(np.diff(slope)).max() < 1.0  # no crease


def test_direction_is_where_it_rises() -> None:
    for direction, rises in ((0.0, (-1, 0)), (90.0, (0, 1)), (180.0, (1, 0)), (270.0, (0, -1))):
        z = made("plane", 33, direction=direction)
        down_rows, along_cols = z[-1, 16] - z[0, 16], z[16, -1] - z[16, 0]
        assert np.sign(np.round((down_rows, along_cols), 2)).tolist() == list(rises)
    z = made("plane", 33, direction=37.0)
    extent = 4.0 * R
    gradient = np.hypot(z[0, 0] - z[0, -1], z[0, 0] - z[-1, 0]) / extent
    assert gradient == pytest.approx(H / R, rel=1e-5)


def test_amplitude_is_the_height_of_the_summit() -> None:
    for surface in set(SHAPES) - {"plane", "saddle", "monkey_saddle"}:
        z = made(surface, 801, 8 * R, wavelength=8 * R / 10, offset=7.0)
        assert z.max() == pytest.approx(H + 7.0, rel=5e-3), surface


def test_every_surface_gives_the_same_bits_on_the_device() -> None:
    assert set(SHAPES) == set(typing.get_args(SurfaceName))
    for surface in ("peaks", "ripple", "torus_ring", "dune_train", "step", "mexican_hat"):
        one, two = (
            made(surface, 65, direction=20.0, device=device)
            for device in ("numpy", None)  # type: ignore[arg-type]
        )
        assert np.array_equal(one, two), surface


@pytest.mark.parametrize("surface", sorted(SHAPES))
def test_extreme_sizes_stay_finite(surface: str) -> None:
    for size in (0.001, 1e8):
        for extent in (1.0, 1e8):
            z = made(surface, 17, extent, amplitude=1e6, radius=size, wavelength=size)
            assert np.isfinite(z).all()
