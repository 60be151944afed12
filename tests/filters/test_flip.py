"""Mirrors exchange two sides and lose nothing."""

from __future__ import annotations

import numpy as np

from terrakit.testing.subjects import CORNERS, compass_terrain, rough_terrain
from terrakit_filters.flip import Flip


def test_sides_change_places() -> None:
    height = Flip(across="east_west")(compass_terrain((5, 9))).elevation
    assert height[0, 0] == CORNERS["north east"]
    assert height[-1, -1] == CORNERS["south west"]
    height = Flip(across="north_south")(compass_terrain((5, 9))).elevation
    assert height[0, 0] == CORNERS["south west"]
    assert height[0, -1] == CORNERS["south east"]


def test_twice_is_as_before_with_every_layer() -> None:
    start = rough_terrain((20, 33)).with_layers(mask_any=np.random.default_rng(1).random((20, 33)))
    for across in ("east_west", "north_south"):
        once = Flip(across=across)(start)
        assert once.grid == start.grid
        assert not np.array_equal(once.layer("mask_any"), start.layer("mask_any"))
        twice = Flip(across=across)(once)
        for name in start:
            assert np.array_equal(twice.layer(name), start.layer(name))
