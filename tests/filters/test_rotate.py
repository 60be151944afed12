"""Turning moves the ground about its middle, and quarter turns lose nothing."""

from __future__ import annotations

import numpy as np
import pytest

from terrakit import Heightfield
from terrakit.testing.subjects import CORNERS, compass_terrain, rough_terrain
from terrakit_filters.rotate import Rotate

AROUND = ("north east", "north west", "south west", "south east")
PLACES = {
    "north west": (0, 0),
    "north east": (0, -1),
    "south east": (-1, -1),
    "south west": (-1, 0),
}


def layered(terrain: Heightfield) -> Heightfield:
    random = np.random.default_rng(2)
    return terrain.with_layers(
        mask_any=random.random(terrain.shape), valid=random.integers(0, 2, terrain.shape)
    )


@pytest.mark.parametrize("shape", [(33, 33), (20, 33)])
def test_four_quarter_turns_give_back_every_bit(shape: tuple[int, int]) -> None:
    start = layered(rough_terrain(shape, 10.0, origin=(5000.0, 300.0)))
    for angle in (90.0, -90.0, 270.0):
        now = start
        for turn in range(4):
            now = Rotate(angle=angle)(now)
            assert now.shape == (shape if turn % 2 else shape[::-1])
        assert now.grid == start.grid
        for name in start:
            assert np.array_equal(now.layer(name), start.layer(name)), name


@pytest.mark.parametrize("quarters", [1, 2, 3])
def test_spikes_land_counter_clockwise(quarters: int) -> None:
    turned = Rotate(angle=90.0 * quarters)(compass_terrain((20, 33))).elevation
    for index, corner in enumerate(AROUND):
        lands = AROUND[(index + quarters) % 4]
        assert turned[PLACES[lands]] == CORNERS[corner], corner


@pytest.mark.parametrize("angle", [90.0, 30.0, -200.0])
def test_the_middle_stays_where_it_is(angle: float) -> None:
    start = rough_terrain((31, 40), 10.0, origin=(1000.0, 2000.0))
    turned = Rotate(angle=angle)(start)
    for terrain in (start, turned):
        (x, y), (width, height) = terrain.origin, terrain.grid.size
        assert (x + width / 2, y - height / 2) == pytest.approx((1195.0, 1850.0))


def test_planes_stay_planes_and_fall_the_turned_way() -> None:
    row, col = np.indices((41, 51))
    start = Heightfield(500 + 3.0 * col + 1.0 * row, 10.0)  # falls to the north west
    turned = Rotate(angle=30.0)(start).elevation.astype(np.float64)
    south, east = np.gradient(turned)
    cosine, sine = np.cos(np.pi / 6), np.sin(np.pi / 6)
    # The gradient (3 east, -1 north) turns counter-clockwise with the ground
    assert np.allclose(east, 3 * cosine + sine, atol=1e-3)
    assert np.allclose(-south, 3 * sine - cosine, atol=1e-3)
    assert np.median(turned) == pytest.approx(np.median(start.elevation), abs=0.1)


def test_there_and_back_again_is_nearly_the_same() -> None:
    y, x = np.indices((81, 81)) * 10.0
    start = Heightfield(100 * np.sin(x / 90) * np.cos(y / 70), 10.0)
    back = Rotate(angle=-40.0)(Rotate(angle=40.0, edges="extend")(start))
    middle = slice(len(back.elevation) // 2 - 15, len(back.elevation) // 2 + 16)
    expected = start.elevation[25:56, 25:56]
    assert np.abs(back.elevation[middle, middle] - expected).max() < 0.5


@pytest.mark.parametrize("angle", [1.0, 30.0, 45.0, 77.0, 135.0, 200.0])
@pytest.mark.parametrize("shape", [(60, 60), (30, 90), (90, 30)])
def test_cropped_corners_hold_ground_only(angle: float, shape: tuple[int, int]) -> None:
    start = Heightfield(np.full(shape, 50.0), 10.0)
    cropped = Rotate(angle=angle, edges="crop")(start)
    level = Rotate(angle=angle, edges="level", edge_height=-7.0)(start)
    assert (cropped.elevation == 50.0).all()
    assert (level.elevation == -7.0).any()
    assert level.grid == start.grid
    # No upright rectangle that fits, of any proportion, is larger by more than a row and a column
    turn = np.radians(angle)
    cosine, sine = abs(np.cos(turn)), abs(np.sin(turn))
    height, width = (n - 1.0 for n in shape)
    ratio = np.geomspace(1e-2, 1e2, 4001)  # of the sides
    wide = np.minimum(width / (cosine + ratio * sine), height / (sine + ratio * cosine))
    rows, cols = cropped.shape
    assert (wide**2 * ratio).max() <= (cols * rows) * 1.001


def test_yes_and_no_stays_yes_and_no() -> None:
    turned = Rotate(angle=33.0, edges="level")(layered(rough_terrain((40, 40))))
    assert set(np.unique(turned.layer("valid"))) == {0.0, 1.0}
    assert turned.layer("mask_any").min() >= 0
    assert turned.layer("mask_any").max() <= 1
