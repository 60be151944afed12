"""What is inside is inside, edges are as soft as said, and unsound outlines are refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import crop
from terrakit_texturing.polygon_mask import PolygonMask
from terrakit_texturing.polygon_mask.outline import distance_to_edge, inside

SQUARE = [[100.0, 100.0], [300.0, 100.0], [300.0, 300.0], [100.0, 300.0]]
HOLE = [[180.0, 180.0], [180.0, 220.0], [220.0, 220.0], [220.0, 180.0]]


def mask(polygons: Any, shape: tuple[int, int] = (41, 41), **settings: Any) -> np.ndarray:
    terrain = Heightfield(np.zeros(shape), 10.0)
    return execute(PolygonMask(polygons=polygons, **settings), terrain, Run()).layer("mask_polygon")


def test_area_is_that_of_the_outline_without_its_hole() -> None:
    ring = [
        [100 * math.cos(t) + 201, 100 * math.sin(t) + 203] for t in np.arange(80) * math.tau / 80
    ]
    round_hole = [[x / 2 + 100.5, y / 2 + 101.5] for x, y in ring]
    told = float(mask([[ring, round_hole]], (401, 401), feather=0.0).sum()) * 100
    full = 0.5 * 80 * math.sin(math.tau / 80) * 100**2
    assert told == pytest.approx(0.75 * full, rel=0.03)


def test_inside_agrees_with_the_winding_of_a_random_star() -> None:
    random = np.random.default_rng(8)
    angles = np.sort(random.uniform(0, math.tau, 30))
    reach = random.uniform(30, 120, 30)
    ring = np.column_stack([200 + reach * np.cos(angles), 190 + reach * np.sin(angles)])
    x, y = np.arange(60) * 7.0, 400 - np.arange(60) * 7.0
    point = np.stack(np.meshgrid(x, y), axis=-1)[:, :, None, :]
    towards = ring[None, None] - point
    bearing = np.arctan2(towards[..., 1], towards[..., 0])
    turned = (np.diff(bearing, axis=-1, append=bearing[..., :1]) + math.pi) % math.tau - math.pi
    winding = np.abs(turned.sum(axis=-1)) > 1.0
    found = inside([ring], x, y)
    assert np.array_equal(found, winding)
    assert found.any()


def test_neighbours_share_no_sample_and_leave_none() -> None:
    west = [[0.0, 0.0], [200.0, 0.0], [130.0, 400.0], [0.0, 400.0]]
    east = [[200.0, 0.0], [400.0, 0.0], [400.0, 400.0], [130.0, 400.0]]
    both = [
        inside([np.array(ring)], np.arange(1, 400, 3.0), 400 - np.arange(1, 400, 3.0))
        for ring in (west, east)
    ]
    assert (both[0] ^ both[1]).all()


@pytest.mark.parametrize(
    ("side", "shift"), [("outside", 0.0), ("middle", -30.0), ("inside", -60.0)]
)
def test_the_soft_edge_is_as_wide_as_said(side: str, shift: float) -> None:
    line = mask([[SQUARE]], feather=60.0, feather_side=side)[20]  # through the middle, eastwards
    beyond = np.arange(41) * 10.0 - 300.0 - shift
    east = slice(20, None)
    t = np.clip(beyond / 60.0, 0, 1)
    assert np.allclose(line[east], (1 - t * t * (3 - 2 * t))[east], atol=1e-6)


def test_distance_is_that_of_a_search_along_the_outline() -> None:
    ring = np.array([[50.0, 60.0], [310.0, 90.0], [170.0, 140.0], [220.0, 300.0]])
    x, y = np.arange(90) * 4.0, 350 - np.arange(150) * 4.0
    share = np.linspace(0, 1, 4001)[:, None]
    dense = np.concatenate(
        [a + share * (b - a) for a, b in zip(ring, np.roll(ring, -1, 0), strict=True)]
    )
    told = distance_to_edge([ring], x, y, 45.0)
    for row, col in ((3, 5), (40, 33), (75, 44), (64, 70), (10, 60), (149, 0)):
        searched = np.hypot(dense[:, 0] - x[col], dense[:, 1] - y[row]).min()
        assert told[row, col] == pytest.approx(min(searched, 45.0), abs=2e-3)


def test_a_tile_equals_the_whole_at_any_place() -> None:
    operator = PolygonMask(polygons=[[[[x + 1e6, y + 2e6] for x, y in SQUARE]]], allow_empty=True)
    whole = Heightfield(np.zeros((60, 60)), 7.3, (1e6, 2e6 + 59 * 7.3))
    tile = crop(whole, 17, 9, 21, 30)
    expected = execute(operator, whole, Run()).layer("mask_polygon")[17:38, 9:39]
    assert np.array_equal(execute(operator, tile, Run()).layer("mask_polygon"), expected)
    assert 0 < expected.mean() < 1


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        (
            [[SQUARE], [[[0, 0], [10, 10], [10, 0], [0, 10]]]],
            r"polygon 2 crosses itself near \(5, 5\)",
        ),
        ([[SQUARE[:2]]], "polygon 1, ring 1 has 2 different points; needs at least 3"),
        ([[[[0, 0], [5, 5], [9, 9]]]], "encloses nothing"),
        ([[[[0, 0], [1e-200, 1e-200], [1e-200, 0]]]], "encloses nothing"),
        ([[SQUARE, [[0, 0], [1, math.nan], [1, 1]]]], "polygon 1, ring 2, point 2 is .*nan"),
        ([[[[0, 0], [1, 1], [math.inf, 1]]]], "point 3"),
        ([[[[0, 0], [1], [1, 1]]]], r"point 2 must be \[x, y\]"),
        ([SQUARE], r"polygon 1, ring 1, point 1 must be"),
        ([[]], "polygon 1 must be a list of at least one ring"),
        ([[[[float(i), float(i * i % 7)] for i in range(30_000)]]], "more than 20000 points"),
    ],
)
def test_unsound_polygons_are_refused_by_number(polygons: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as told:
        PolygonMask(polygons=polygons)
    assert "polygons" in str(told.value)
    assert "\n" not in str(told.value)


def test_corners_on_edges_and_closed_rings_are_sound() -> None:
    touching = [
        [100.0, 100.0],
        [200.0, 200.0],
        [300.0, 100.0],
        [300.0, 300.0],
        [200.0, 200.0],
        [100.0, 300.0],
    ]
    assert mask([[touching]]).any()
    assert np.array_equal(mask([[[*SQUARE, SQUARE[0]]]]), mask([[SQUARE]]))
    assert np.array_equal(mask([[SQUARE, HOLE]]), mask([[SQUARE, HOLE[::-1]]]))


def test_polygons_beside_the_terrain_are_refused_with_where_they_lie() -> None:
    with pytest.raises(InputError, match="cover 5100 to 5300 m east and 100 to 300 m north"):
        mask([[[[x + 5000, y] for x, y in SQUARE]]])
    with pytest.raises(InputError, match=r"polygons = \[\]"):
        mask([])
