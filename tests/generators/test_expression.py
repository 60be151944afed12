"""A formula of one's own becomes terrain: where it says, as high as it says, or one line."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Grid, ParameterError, Run
from terrakit.execute import execute
from terrakit.heightfield import Heightfield
from terrakit_generators.expression import Expression

GRID = Grid((41, 61), 25.0, (1000.0, 5000.0))


def made(grid: Grid = GRID, device: str = "numpy", **settings: object) -> Heightfield:
    terrain: Heightfield = execute(Expression(**settings), grid, Run(1, device))
    return terrain


def test_names_mean_places_in_the_world() -> None:
    col, row = np.meshgrid(np.arange(61), np.arange(41))
    east, north = 1000.0 + 25.0 * col, 5000.0 - 25.0 * row
    x, y = east - 1100.0, north - 4300.0
    center = [1100.0, 4300.0]
    for name, expected in {
        "x": x,
        "y": y,
        "r": np.hypot(x, y),
        "1000*theta": 1000 * np.arctan2(y, x),
        "east": east,
        "north": north,
    }.items():
        assert made(formula=name, center=center).elevation == pytest.approx(expected, abs=1e-3)


def test_without_a_center_it_is_measured_from_the_middle_of_the_world() -> None:
    terrain = made(formula="x + 1000*y").elevation
    assert terrain[20, 30] == 0.0
    tile = Grid((21, 31), 25.0, (1000.0 + 30 * 25.0, 5000.0 - 20 * 25.0))
    part = execute(Expression(formula="x + 1000*y"), tile, Run(1, "numpy", world=GRID))
    assert np.array_equal(part.elevation, terrain[20:, 30:])


def test_finer_samples_show_the_same_ground() -> None:
    text = "90*sin(x/200) + 40*fbm(300, 3)"
    coarse = made(Grid((33, 33), 20.0), formula=text).elevation
    fine = made(Grid((65, 65), 10.0), formula=text).elevation
    assert fine[::2, ::2] == pytest.approx(coarse, abs=1e-3)


def test_seed_moves_the_noise_alone() -> None:
    one, two = (made(formula="x + fbm(200)", seed=seed).elevation for seed in (1, 2))
    plain = made(formula="x").elevation
    assert np.abs(one - plain).max() <= 1.001
    assert np.abs(one - two).max() > 0.1
    assert np.array_equal(*(made(formula="x*y/100", seed=seed).elevation for seed in (1, 2)))


@pytest.mark.parametrize("formula", ["log(x)", "1/(x - 100)", "100*sqrt(y)"])
@pytest.mark.parametrize("device", ["numpy", None])
def test_heights_that_are_no_numbers_are_told_with_their_place(
    formula: str, device: str | None
) -> None:
    with pytest.raises(ParameterError, match="not finite, first at east .* guard it") as refusal:
        execute(Expression(formula=formula), GRID, Run(1, device))
    message = str(refusal.value)
    assert formula in message
    assert "\n" not in message


def test_it_is_told_inside_of_another_formula_too() -> None:
    from terrakit.testing.subjects import rough_terrain
    from terrakit_filters.blend import Blend

    blend = Blend(other=Expression(formula="log(x)"))
    with pytest.raises(ParameterError, match=r"blend: formula = 'log\(x\)'"):
        execute(blend, rough_terrain(), Run(1, "numpy"))


def test_what_is_no_arithmetic_is_refused_with_the_parameter() -> None:
    with pytest.raises(ParameterError, match="^expression: formula = 'import os': is no arith"):
        Expression(formula="import os")
    with pytest.raises(ParameterError, match="^expression: define.k = 'q'.*no such name"):
        Expression(formula="k", define={"k": "q"})
    with pytest.raises(ParameterError, match="expression: formula = 3"):
        Expression(formula=3)


@pytest.mark.parametrize("preset", sorted(Expression.presets))
def test_presets_make_ground_of_some_relief(preset: str) -> None:
    operator = Expression.from_settings({"preset": preset}, "test")
    z = execute(operator, Grid((64, 64), 90.0), Run(1, "numpy")).elevation
    assert 20.0 < np.ptp(z) < 3000.0
