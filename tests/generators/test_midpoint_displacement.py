"""Midpoint displacement: edges of their own, and the creases that come of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Run
from terrakit_generators.diamond_square import DiamondSquare
from terrakit_generators.lattice_subdivision import reference
from terrakit_generators.midpoint_displacement import MidpointDisplacement

Heights = NDArray[np.float64]


def made(kind: Any, size: int = 513, seed: int = 1, **settings: Any) -> Heights:
    terrain = kind(**settings).generate(Grid((size, size), 10.0), Run(seed))
    return terrain.elevation.astype(np.float64)


def measured_exponent(z: Heights) -> float:
    lags = (1, 2, 4, 8, 16, 32)
    means = [((z[k:] - z[:-k]) ** 2).mean() + ((z[:, k:] - z[:, :-k]) ** 2).mean() for k in lags]
    return 0.5 * float(np.polyfit(np.log(lags), np.log(means), 1)[0])


@pytest.mark.parametrize(
    ("nominal", "expected"), [(0.3, 0.31), (0.5, 0.47), (0.75, 0.71), (0.9, 0.86)]
)
def test_variogram_has_the_stated_bias(nominal: float, expected: float) -> None:
    found = [
        measured_exponent(
            made(MidpointDisplacement, 513, s, wavelength=5120.0, hurst_exponent=nominal)
        )
        for s in range(4)
    ]
    assert np.mean(found) == pytest.approx(expected, abs=0.04)


def test_a_level_is_edges_and_centres() -> None:
    noise = reference.Noise((1, 2, 3, 4), 0.0, 0.0, False, False)
    spike = np.zeros((5, 5), dtype=np.float32)
    spike[2, 2] = 16.0
    fine = reference.refine("midpoint", spike, noise, (0, 0), (1, 1), (3, 3))
    expected = [[4, 8, 4], [8, 16, 8], [4, 8, 4]]
    assert np.array_equal(fine[1:4, 1:4], expected)
    assert fine.sum() == 64


def test_an_edge_does_not_know_the_land_beside_it() -> None:
    noise = reference.Noise((5, 6, 7, 8), 3.0, 2.0, False, False)
    land = np.random.default_rng(1).normal(size=(6, 6)).astype(np.float32)
    other = land.copy()
    other[3:] += 9.0  # south of coarse row 2
    fine = [reference.refine("midpoint", z, noise, (0, 0), (1, 1), (4, 4)) for z in (land, other)]
    assert np.array_equal(fine[0][2], fine[1][2])  # the whole of row 2, edges too
    assert not np.array_equal(fine[0][3], fine[1][3])


def test_creases_follow_the_coarse_lattice() -> None:
    def crease(kind: Any) -> float:
        """Return how much more the ground bends across lines of the coarse lattice."""
        ratio = []
        for seed in range(6):
            z = made(kind, 257, seed, wavelength=640.0, hurst_exponent=0.95)
            bend = np.abs(z[2:] - 2 * z[1:-1] + z[:-2]).mean(axis=1)
            on = np.arange(63, 255, 64)  # rows of the coarsest lattice, the first one cut off
            ratio.append(bend[on].mean() / np.median(bend))
        return float(np.mean(ratio))

    assert crease(MidpointDisplacement) > 1.3
    assert crease(MidpointDisplacement) > 1.15 * crease(DiamondSquare)
