"""Square-square: a spline without noise, no creases with it, and where it says it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Run
from terrakit_generators.lattice_subdivision import reference
from terrakit_generators.square_square import SquareSquare

Heights = NDArray[np.float64]


def made(size: int = 513, seed: int = 1, **settings: Any) -> Heights:
    operator = SquareSquare(**settings)
    return operator.generate(Grid((size, size), 10.0), Run(seed)).elevation.astype(np.float64)


def measured_exponent(z: Heights) -> float:
    lags = (1, 2, 4, 8, 16, 32)
    means = [((z[k:] - z[:-k]) ** 2).mean() + ((z[:, k:] - z[:, :-k]) ** 2).mean() for k in lags]
    return 0.5 * float(np.polyfit(np.log(lags), np.log(means), 1)[0])


@pytest.mark.parametrize(
    ("nominal", "expected"), [(0.3, 0.45), (0.5, 0.58), (0.75, 0.76), (0.9, 0.87)]
)
def test_variogram_has_the_stated_bias(nominal: float, expected: float) -> None:
    found = [
        measured_exponent(made(513, s, wavelength=5120.0, hurst_exponent=nominal)) for s in range(4)
    ]
    assert np.mean(found) == pytest.approx(expected, abs=0.04)


def test_weights_are_nine_three_three_one() -> None:
    noise = reference.Noise((1, 2, 3, 4), 0.0, 0.0, False, False)
    spike = np.zeros((5, 5), dtype=np.float32)
    spike[2, 2] = 16.0
    fine = reference.refine("square_square", spike, noise, (0, 0), (1, 1), (3, 3))
    around = [[1, 3, 3, 1], [3, 9, 9, 3], [3, 9, 9, 3], [1, 3, 3, 1]]
    assert np.array_equal(fine[:4, :4], around)
    assert fine.sum() == 64


@pytest.mark.parametrize("spacing", [20.0, 7.0])
def test_without_noise_it_is_the_quadratic_spline(
    spacing: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scipy.interpolate import BSpline

    operator, run, wavelength = SquareSquare(wavelength=160.0), Run(3), 160.0
    whole = SquareSquare._noises

    def silent(self: SquareSquare, run: Run, levels: int) -> list[reference.Noise]:
        return [reference.Noise(n.seeds, 0.0, 0.0, False, False) for n in whole(self, run, levels)]

    monkeypatch.setattr(SquareSquare, "_noises", silent)
    grid = Grid((40, 50), spacing, (1000.0, 3000.0))
    z = operator.generate(grid, run).elevation
    # The coarsest lattice at the places where the world says it lies
    x = 1000.0 + spacing * np.arange(50)
    south = -3000.0 + spacing * np.arange(40)
    first = int(south[0] // wavelength) - 2, int(x[0] // wavelength) - 2
    from terrakit.running import seed_words

    words = seed_words(*run.words("square_square", 0), 0)
    control = reference.scatter(words, operator.amplitude, False, first, (13, 13)).astype(float)
    for axis, along in ((0, south), (1, x)):
        knots = (np.arange(13 + 3) + first[axis] - 1.5) * wavelength
        control = np.moveaxis(BSpline(knots, np.moveaxis(control, axis, 0), 2)(along), 0, axis)
    assert np.abs(z - control).max() < 2e-3
    assert np.ptp(z) > 300.0


def test_no_crease_on_the_coarse_lattice() -> None:
    ratio = []
    for seed in range(6):
        z = made(257, seed, wavelength=640.0, hurst_exponent=0.95)
        bend = np.abs(z[2:] - 2 * z[1:-1] + z[:-2]).mean(axis=1)
        ratio.append(bend[np.arange(63, 255, 64)].mean() / np.median(bend))
    assert np.mean(ratio) < 1.1


def test_directions_are_alike() -> None:
    ratios = []
    for seed in range(6):
        z = made(513, seed, wavelength=640.0)
        straight = [(d**2).mean() for d in (z[24:] - z[:-24], z[:, 24:] - z[:, :-24])]
        slant = [(d**2).mean() for d in (z[17:, 17:] - z[:-17, :-17], z[17:, :-17] - z[:-17, 17:])]
        ratios.append(np.mean(slant) / np.mean(straight))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
