"""Views of a terrain as a block: in frame, right way round, near before far, without holes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from terrakit.perspective import Camera, perspective_image, with_sediment, with_water

SIZE = (180, 100)


def cone(side: int = 65, height: float = 300.0, spacing: float = 10.0) -> np.ndarray:
    row, col = np.mgrid[:side, :side] - side // 2
    return np.maximum(0.0, height - np.hypot(row, col) * spacing).astype(np.float32)


def painted(shape: tuple[int, int], **where: tuple[slice, slice]) -> np.ndarray:
    colours = np.full((*shape, 3), 0.05, np.float32)
    for channel, name in enumerate(("red", "green", "blue")):
        if name in where:
            colours[(*where[name], channel)] = 1.0
    return colours


def middle_of(picture: np.ndarray, channel: int) -> tuple[float, float]:
    """Return row and column of the middle of the pixels of one colour."""
    values = picture.astype(int)
    others = [c for c in range(3) if c != channel]
    rows, cols = np.nonzero(values[..., channel] > 60 + values[..., others].max(axis=-1))
    assert len(rows) > 20
    return float(rows.mean()), float(cols.mean())


@pytest.mark.parametrize(("direction", "turn"), [(0.0, 0), (90.0, 1), (180.0, 2), (270.0, 3)])
def test_corners_are_where_the_viewer_expects_them(direction: float, turn: int) -> None:
    low, high = slice(0, 20), slice(45, 65)
    # Looking north: red in the north-west is far and left, green in the south-east near and right
    colours = painted((65, 65), red=(low, low), green=(high, high), blue=(high, low))
    colours = np.rot90(colours, -turn).copy()  # clockwise, as the viewer turns
    flat = np.zeros((65, 65), np.float32)
    picture = perspective_image(
        flat, 10.0, colours=colours, size=SIZE, direction=direction, pitch=30.0
    )
    red, green, blue = (middle_of(picture, channel) for channel in range(3))
    assert red[0] < blue[0] - 10
    assert red[1] < green[1] - 30
    assert blue[1] < green[1] - 30
    assert abs(blue[0] - green[0]) < 4


def test_a_ridge_hides_what_is_behind_it() -> None:
    ground = np.zeros((65, 65), np.float32)
    colours = painted((65, 65), blue=(slice(10, 20), slice(20, 45)))
    seen = perspective_image(ground, 10.0, colours=colours, size=SIZE, direction=0.0, pitch=20.0)
    middle_of(seen, 2)
    ground[40:44] = 400.0
    hidden = perspective_image(ground, 10.0, colours=colours, size=SIZE, direction=0.0, pitch=20.0)
    values = hidden.astype(int)
    assert not (values[..., 2] > 60 + values[..., :2].max(axis=-1)).any()
    # From the other side the ridge is behind
    middle_of(
        perspective_image(ground, 10.0, colours=colours, size=SIZE, direction=180.0, pitch=20.0), 2
    )


@pytest.mark.parametrize("pitch", [8.0, 26.0, 60.0])
@pytest.mark.parametrize("direction", [0.0, 18.0, 45.0, 200.0])
def test_the_camera_has_every_corner_in_frame_and_fills_it(direction: float, pitch: float) -> None:
    extent, heights, size = (3000.0, 5000.0), (-200.0, 900.0), (900, 500)
    camera = Camera.around(extent, heights, size, direction, pitch)
    bearing = math.radians(direction)
    across, upright = [], []
    for east in (-extent[0] / 2, extent[0] / 2):
        for north in (-extent[1] / 2, extent[1] / 2):
            for z in heights:
                right = east * math.cos(bearing) - north * math.sin(bearing)
                ahead = east * math.sin(bearing) + north * math.cos(bearing) + camera.distance
                assert ahead > 0
                across.append(2 * (right - camera.aside) / ahead * camera.focus)
                rise = (z - camera.height) / ahead + camera.shift
                upright.append(2 * rise * camera.focus * size[0] / size[1])
    largest = max(*map(abs, across), *map(abs, upright))
    assert largest == pytest.approx(0.95, abs=1e-9)


def test_there_are_no_holes_and_no_steps() -> None:
    colours = np.zeros((65, 65, 3), np.float32)
    colours[..., 1] = 1.0
    picture = perspective_image(cone(), 10.0, colours=colours, size=SIZE).astype(int)
    green = picture[..., 1] > 2 * picture[..., 0]
    for column in green.T:
        rows = np.flatnonzero(column)
        if len(rows):
            assert len(rows) == rows[-1] - rows[0] + 1
    # A flat block under one light darkens smoothly into the haze
    flat = perspective_image(np.zeros((65, 65)), 10.0, colours=colours, size=SIZE, direction=0.0)
    along = flat[:, 90, 1].astype(int)[flat[:, 90, 1] > 2 * flat[:, 90, 0].astype(int)]
    assert len(along) > 30
    assert np.abs(np.diff(along[2:-2])).max() <= 3


def test_slopes_to_the_sun_are_bright_and_those_behind_lie_in_shadow() -> None:
    plain = np.full((129, 129, 3), 0.4, np.float32)
    hill = cone(129, 900.0, 10.0)
    west = perspective_image(
        hill, 10.0, colours=plain, azimuth=270.0, size=SIZE, direction=0.0
    ).astype(float)
    east = perspective_image(
        hill, 10.0, colours=plain, azimuth=90.0, size=SIZE, direction=0.0
    ).astype(float)
    left, right = (slice(40, 70), slice(60, 85)), (slice(40, 70), slice(95, 120))
    assert west[left].mean() > west[right].mean() + 20
    assert east[right].mean() > east[left].mean() + 20


def test_water_lies_level_and_loose_material_is_sand() -> None:
    ground = cone(65, 300.0)
    sea = perspective_image(ground, 10.0, sea_level=150.0, size=SIZE).astype(int)
    dry = perspective_image(ground, 10.0, size=SIZE).astype(int)
    assert ((sea[..., 2] > sea[..., 0] + 20).mean() - (dry[..., 2] > dry[..., 0] + 20).mean()) > 0.2
    depth = np.maximum(0.0, 150.0 - ground)
    as_layer = perspective_image(ground, 10.0, water_depth=depth, size=SIZE)
    assert np.array_equal(as_layer, sea)
    grey = np.full((3, 3, 3), 0.3, np.float32)
    assert np.array_equal(with_water(grey, np.full((3, 3), 0.01)), grey)
    assert np.array_equal(with_sediment(grey, np.zeros((3, 3))), grey)
    assert (with_sediment(grey, np.full((3, 3), 9.0))[..., 2] < 0.3).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1), (2, 2), (3, 200)])
@pytest.mark.parametrize("height", [-5.0, 0.0, 1e6])
def test_tiny_terrains_have_a_picture(shape: tuple[int, int], height: float) -> None:
    picture = perspective_image(np.full(shape, height), 10.0, sea_level=0.0, size=(45, 25))
    assert picture.shape == (25, 45, 3)
    assert picture.dtype == np.uint8


def test_the_same_heights_give_the_same_frame() -> None:
    flat, hill = np.zeros((33, 33), np.float32), cone(33, 150.0)
    views = [
        perspective_image(ground, 10.0, size=SIZE, heights=(0.0, 150.0)) for ground in (flat, hill)
    ]
    foot = [np.argmax(np.any(view[::-1, :, 0] < 130, axis=1)) for view in views]
    assert foot[0] == foot[1]
