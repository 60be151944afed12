"""Diamond-square: as rough as its sheet says, alike in all directions, corners untouched."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Run
from terrakit_generators.diamond_square import DiamondSquare
from terrakit_generators.lattice_subdivision import reference

Heights = NDArray[np.float64]


def made(size: int = 513, seed: int = 1, **settings: Any) -> Heights:
    operator = DiamondSquare(**settings)
    return operator.generate(Grid((size, size), 10.0), Run(seed)).elevation.astype(np.float64)


def measured_exponent(z: Heights) -> float:
    lags = (1, 2, 4, 8, 16, 32)
    means = [((z[k:] - z[:-k]) ** 2).mean() + ((z[:, k:] - z[:, :-k]) ** 2).mean() for k in lags]
    return 0.5 * float(np.polyfit(np.log(lags), np.log(means), 1)[0])


@pytest.mark.parametrize(
    ("nominal", "expected"), [(0.3, 0.30), (0.5, 0.45), (0.75, 0.68), (0.9, 0.83)]
)
@pytest.mark.parametrize("additions", [False, True])
def test_variogram_has_the_stated_bias(nominal: float, expected: float, additions: bool) -> None:
    found = [
        measured_exponent(
            made(513, s, wavelength=5120.0, hurst_exponent=nominal, additions=additions)
        )
        for s in range(4)
    ]
    assert np.mean(found) == pytest.approx(expected, abs=0.04)


def test_directions_are_alike() -> None:
    ratios = []
    for seed in range(6):
        z = made(513, seed, wavelength=640.0)
        straight = [(d**2).mean() for d in (z[24:] - z[:-24], z[:, 24:] - z[:, :-24])]
        slant = [(d**2).mean() for d in (z[17:, 17:] - z[:-17, :-17], z[17:, :-17] - z[:-17, 17:])]
        ratios.append(np.mean(slant) / np.mean(straight))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)


def test_a_level_is_corners_diamonds_and_squares() -> None:
    noise = reference.Noise((1, 2, 3, 4), 0.0, 0.0, False, False)
    spike = np.zeros((7, 7), dtype=np.float32)
    spike[3, 3] = 16.0
    fine = reference.refine("diamond_square", spike, noise, (0, 0), (1, 1), (5, 5))
    around = fine[1:8, 1:8]
    expected = np.array(
        [
            [0, 0, 0, 0, 0, 0, 0],
            [0, 0, 1, 0, 1, 0, 0],
            [0, 1, 4, 6, 4, 1, 0],
            [0, 0, 6, 16, 6, 0, 0],
            [0, 1, 4, 6, 4, 1, 0],
            [0, 0, 1, 0, 1, 0, 0],
            [0, 0, 0, 0, 0, 0, 0],
        ]
    )
    assert np.array_equal(around, expected)


def test_additions_displace_old_points_at_every_level() -> None:
    settings = {"wavelength": 80.0, "hurst_exponent": 0.5, "amplitude": 100.0}
    plain, added = (
        [made(513, seed, additions=additions, **settings)[::8, ::8] for seed in range(4)]
        for additions in (False, True)
    )
    gained = np.var(np.subtract(added, plain))
    first = 2 * (2**-0.5 - 0.25 - 2**-2.5)  # variance of the first half-step, in amplitudes
    levels = sum(2.0**-level for level in range(3))
    assert gained == pytest.approx(100.0**2 * first * (1 + 2**-0.5) * levels, rel=0.06)


def test_points_of_all_levels_vary_alike() -> None:
    squares = np.zeros((64, 64))
    for seed in range(8):
        z = made(514, seed, wavelength=640.0, hurst_exponent=0.5)[1:513, 1:513]
        squares += (z.reshape(8, 64, 8, 64) ** 2).mean(axis=(0, 2))
    deviation = np.sqrt(squares)
    assert deviation.std() < 0.06 * deviation.mean()


def test_half_step_lowers_only_the_edges() -> None:
    grid = Grid((3, 3), 10.0)
    half, full = (
        DiamondSquare(wavelength=20.0, half_step=h).generate(grid, Run(1)).elevation
        for h in (True, False)
    )
    same = half == full
    assert np.array_equal(same, [[1, 0, 1], [0, 1, 0], [1, 0, 1]])
