"""What all subdivisions share: one land in the world, however it is cut, moved or sampled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, ParameterError, Run
from terrakit_generators.diamond_square import DiamondSquare
from terrakit_generators.lattice_subdivision import LatticeSubdivision, _Lattice, reference
from terrakit_generators.midpoint_displacement import MidpointDisplacement
from terrakit_generators.square_square import SquareSquare

Heights = NDArray[np.float32]
ALL = (DiamondSquare, MidpointDisplacement, SquareSquare)
RULES = ("diamond_square", "midpoint", "square_square")


def made(operator: LatticeSubdivision, grid: Grid, seed: int = 1, device: Any = None) -> Heights:
    return operator.generate(grid, Run(seed, device)).elevation


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("spacing", [10.0, 7.3])
@pytest.mark.parametrize("origin", [(0.0, 0.0), (1e6, -3e6), (123.4, 567.8)])
def test_tile_equals_whole(kind: Any, spacing: float, origin: tuple[float, float]) -> None:
    operator = kind(wavelength=640.0)  # a level at 10 m, none at 7.3 m
    whole = made(operator, Grid((90, 110), spacing, origin))
    place = (origin[0] + 41 * spacing, origin[1] - 33 * spacing)
    for device in (None, "numpy"):
        tile = made(operator, Grid((37, 50), spacing, place), device=device)
        assert tile.tobytes() == whole[33:70, 41:91].tobytes()


@pytest.mark.parametrize("kind", ALL)
def test_bands_do_not_show(kind: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    operator, grid = kind(), Grid((75, 40), 12.0, (3e5, 7.0))
    whole = made(operator, grid)
    monkeypatch.setattr("terrakit_generators.lattice_subdivision.LARGEST_BAND", 1000)
    assert len(_Lattice(grid, 5000.0, operator.is_shifted).bands()) > 5
    for device in (None, "numpy"):
        assert made(operator, grid, device=device).tobytes() == whole.tobytes()


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        (DiamondSquare, {"additions": True}),
        (DiamondSquare, {"noise": "uniform", "half_step": False}),
        (MidpointDisplacement, {"additions": True, "noise": "uniform"}),
        (SquareSquare, {"noise": "uniform"}),
    ],
)
def test_every_setting_gives_the_same_bits(kind: Any, settings: dict[str, Any]) -> None:
    operator, grid = kind(**settings), Grid((61, 83), 9.0, (-5e4, 1e3))
    assert made(operator, grid).tobytes() == made(operator, grid, device="numpy").tobytes()
    assert made(operator, grid).tobytes() != made(kind(), grid).tobytes()


@pytest.mark.parametrize("kind", [DiamondSquare, MidpointDisplacement])
def test_finer_samples_keep_the_old_ones(kind: Any) -> None:
    operator = kind(wavelength=1280.0)
    coarse, fine = (made(operator, Grid((n, n), s)) for n, s in ((65, 20.0), (257, 5.0)))
    assert np.array_equal(fine[::4, ::4], coarse)


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("wavelength", [1280.0, 1000.0])
def test_twice_the_samples_only_add_octaves(kind: Any, wavelength: float) -> None:
    operator = kind(wavelength=wavelength, hurst_exponent=0.9, amplitude=100.0)
    coarse, fine = (made(operator, Grid((n, n), s)) for n, s in ((129, 20.0), (257, 10.0)))
    missing = (fine[::2, ::2] - coarse).std()
    # The variogram at the coarse spacing bounds what levels below it can hold
    assert missing < 0.6 * np.diff(coarse, axis=0).std()
    assert missing < 0.03 * coarse.std()


@pytest.mark.parametrize("kind", ALL)
def test_seeds_scatter_around_the_offset(kind: Any) -> None:
    operator, grid = kind(wavelength=100.0, offset=250.0, amplitude=80.0), Grid((129, 129), 10.0)
    heights = [made(operator, grid, seed).astype(np.float64) for seed in range(10)]
    # About 170 lattice points of deviation 80 m in each
    assert np.mean([z.mean() for z in heights]) == pytest.approx(250.0, abs=6.0)
    assert 40.0 < np.mean([z.std() for z in heights]) < 90.0


@pytest.mark.parametrize("rule", RULES)
def test_planes_stay_planes(rule: str) -> None:
    silent = reference.Noise((1, 2, 3, 4), 0.0, 0.0, False, True)
    row, col = np.indices((9, 11), dtype=np.float32)
    plane = 8 * row - 16 * col + 3
    fine = reference.refine(rule, plane, silent, (2, 2), (1, 1), (7, 9))
    shift = 0.25 if rule == "square_square" else 0.0
    row, col = np.indices(fine.shape) / 2 + 1 + shift
    assert np.array_equal(fine, 8 * row - 16 * col + 3)


@pytest.mark.parametrize("noise", ["gaussian", "uniform"])
def test_random_numbers_have_deviation_one(noise: str) -> None:
    index = reference.indices(-200, 400)
    values = reference.random((3, 4), index[None, :], index[:, None], noise == "uniform")
    assert values.mean() == pytest.approx(0.0, abs=0.01)
    assert values.std() == pytest.approx(1.0, abs=0.01)
    flatness = float((values.astype(np.float64) ** 4).mean())
    assert flatness == pytest.approx(1.8 if noise == "uniform" else 2.7, abs=0.05)
    neighbours = (values[:, 1:] * values[:, :-1]).mean(), (values[1:] * values[:-1]).mean()
    assert max(map(abs, neighbours)) < 0.01


def test_waves_below_the_spacing_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"wavelength = 5: .* 10 m"):
        made(DiamondSquare(wavelength=5.0), Grid((9, 9), 10.0))
