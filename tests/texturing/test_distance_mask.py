"""Distances are exact, and to what was named."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit_texturing.distance_mask import DistanceMask, to_nearest


def test_distances_are_those_of_a_search_over_all_targets() -> None:
    target = np.random.default_rng(3).random((40, 53)) > 0.985
    assert target.sum() > 5
    row, col = np.indices(target.shape)
    there = np.argwhere(target)
    gaps = (row[..., None] - there[:, 0]) ** 2 + (col[..., None] - there[:, 1]) ** 2
    expected = (np.sqrt(gaps.min(axis=-1).astype(np.float64)) * 7.3).astype(np.float32)
    assert np.array_equal(to_nearest(target, 7.3), expected)


def terrain(spacing: float = 10.0) -> Heightfield:
    """Return land that rises to the east out of a sea at 0 m, which ends between two samples."""
    rise = np.arange(40) * spacing - 19.5 * spacing
    river = np.zeros((30, 40))
    river[12] = 5.0
    return Heightfield(np.tile(rise, (30, 1)), spacing, layers={"mask_river": river})


def test_a_layer_is_near_where_it_exceeds_the_threshold() -> None:
    how = {"target": "layer", "target_layer": "mask_river", "threshold": 4.0}
    how |= {"distance_max": 30.0, "distance_blend": 20.0}
    mask = execute(DistanceMask(**how), terrain(), Run()).layer("mask_distance")[:, 7]
    assert (mask[9:16] == 1.0).all()
    assert mask[8] == mask[16] == 0.5
    assert not mask[:8].any()
    assert not mask[17:].any()


def test_the_coast_is_near_from_both_sides() -> None:
    how = DistanceMask(target="coast", distance_max=25.0, distance_blend=0.0)
    mask = execute(how, terrain(), Run(sea_level=0.0)).layer("mask_distance")[5]
    assert np.flatnonzero(mask).tolist() == [18, 19, 20, 21]


def test_the_border_is_near_on_all_four_sides() -> None:
    how = {"target": "border", "distance_min": 20.0, "distance_max": 1e9, "distance_blend": 0.0}
    mask = execute(DistanceMask(**how), terrain(), Run()).layer("mask_distance")
    assert (mask[2:-2, 2:-2] == 1.0).all()
    assert mask.sum() == mask[2:-2, 2:-2].size


def test_what_is_missing_is_named() -> None:
    with pytest.raises(ParameterError, match="has no sea; set sea_level"):
        execute(DistanceMask(target="coast"), terrain(), Run())
    with pytest.raises(ParameterError, match="target_layer is missing"):
        DistanceMask(target="layer")
    with pytest.raises(ParameterError, match="'mask_rivr'.*did you mean mask_river"):
        execute(DistanceMask(target="layer", target_layer="mask_rivr"), terrain(), Run())


def test_nothing_is_near_what_is_not_there() -> None:
    how = {"target": "layer", "target_layer": "mask_river", "threshold": 9.0, "allow_empty": True}
    result = execute(DistanceMask(**how, distance_max=1e9), terrain(), Run())
    assert not result.layer("mask_distance").any()
