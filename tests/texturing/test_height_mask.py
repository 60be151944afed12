"""Ground is chosen by its height in metres."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield, InputError, Run
from terrakit.execute import execute
from terrakit_texturing.height_mask import HeightMask


def mask(heights: list[float], **settings: object) -> list[float]:
    terrain = Heightfield(np.tile(heights, (3, 1)), 10.0)
    return execute(HeightMask(**settings), terrain, Run()).layer("mask_height")[1].tolist()


def test_full_between_the_limits_and_faded_beyond() -> None:
    told = mask([49, 75, 100, 200, 225, 251], height_min=100.0, height_max=200.0, height_blend=50.0)
    assert told == [0.0, 0.5, 1.0, 1.0, 0.5, 0.0]


def test_without_a_limit_the_mask_is_open() -> None:
    assert mask([-9000, 0, 9000], height_min=0.0, height_blend=0.0) == [0.0, 1.0, 1.0]
    assert mask([-9000, 0, 9000], height_max=0.0, height_blend=0.0) == [1.0, 1.0, 0.0]
    assert mask([-9000, 0, 9000]) == [1.0, 1.0, 1.0]


def test_an_empty_mask_names_its_limits() -> None:
    with pytest.raises(InputError, match="no ground lies between 500 and inf m; move height_min"):
        mask([1, 2, 3], height_min=500.0)
