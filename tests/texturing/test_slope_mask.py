"""Slopes are chosen by their angle, and every mask obeys what all masks promise."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Grid, Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit_texturing.height_mask import HeightMask
from terrakit_texturing.slope_mask import SlopeMask


def ramp(angle: float, spacing: float = 10.0) -> Heightfield:
    """Return ground that rises to the east by ``angle``."""
    east = np.arange(20) * spacing * np.tan(np.radians(angle))
    return Heightfield(np.tile(east, (9, 1)), spacing)


def on_ramp(angle: float, spacing: float = 10.0, **settings: object) -> float:
    settings = {"allow_empty": True, **settings}
    mask = execute(SlopeMask(**settings), ramp(angle, spacing), Run()).layer("mask_slope")
    assert np.ptp(mask) < 1e-3
    return float(mask[4, 9])


@pytest.mark.parametrize("spacing", [0.5, 10.0, 300.0])
def test_the_angles_are_the_ground_s_own(spacing: float) -> None:
    how = {"slope_min": 30.0, "slope_max": 40.0, "slope_blend": 4.0}
    told = {angle: on_ramp(angle, spacing, **how) for angle in (25.9, 28.0, 30.1, 39.9, 42.0, 44.1)}
    assert told[25.9] == told[44.1] == 0.0
    assert told[30.1] == told[39.9] == 1.0
    assert 0.4 < told[28.0] < 0.6
    assert 0.4 < told[42.0] < 0.6


def test_no_blend_is_a_sharp_edge_that_includes_both_limits() -> None:
    how = {"slope_min": 45.0, "slope_max": 45.0, "slope_blend": 0.0}
    assert on_ramp(45.0, **how) == 1.0
    assert on_ramp(44.9, **how) == on_ramp(45.1, **how) == 0.0


def test_open_limits_select_flat_ground_and_cliffs() -> None:
    assert on_ramp(0.0, slope_min=0.0, slope_max=10.0) == 1.0
    assert on_ramp(89.0, slope_min=60.0) == 1.0
    assert on_ramp(5.0, slope_min=0.0, slope_max=90.0) == 1.0


def test_inverted_masks_sum_to_one() -> None:
    for angle in (27.0, 28.5, 30.0):
        how = {"slope_min": 30.0}
        assert on_ramp(angle, **how) + on_ramp(angle, invert=True, **how) == pytest.approx(1.0)


def test_an_empty_mask_is_refused_with_the_way_out() -> None:
    with pytest.raises(InputError, match=r"mask_slope is 0 everywhere.*lower slope_min.*allow_em"):
        execute(SlopeMask(slope_min=60.0), ramp(10.0), Run())
    with pytest.raises(InputError, match="everything is selected"):
        execute(SlopeMask(slope_min=0.0, invert=True), ramp(10.0), Run())


def test_a_tile_of_a_larger_world_may_be_empty() -> None:
    world = Grid((200, 200), 10.0)
    result = execute(SlopeMask(slope_min=60.0), ramp(10.0), Run(world=world))
    assert not result.layer("mask_slope").any()


@pytest.mark.parametrize("layer", ["slope", "mask_", "mask_Äh", "elevation", "mask_a b"])
def test_only_masks_may_be_written(layer: str) -> None:
    with pytest.raises(ParameterError, match="must begin with mask_"):
        SlopeMask(layer=layer)


def test_limits_the_wrong_way_round_are_refused() -> None:
    with pytest.raises(ParameterError, match="slope_min = 50: must not be above slope_max = 40"):
        SlopeMask(slope_min=50.0, slope_max=40.0)
    with pytest.raises(ParameterError, match="height_min = 9: must not be above height_max = 8"):
        HeightMask(height_min=9.0, height_max=8.0)
