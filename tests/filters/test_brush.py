"""Strokes replay: the same in metres however they were recorded, on every device, in order."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from terrakit import Grid, Heightfield, InputError, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import crop, rough_terrain
from terrakit_filters.brush import Brush

LINE = [[100.0, 150.0], [300.0, 250.0], [350.0, 120.0]]


def painted(terrain: Heightfield, *strokes: dict[str, Any], **run: Any) -> np.ndarray:
    return execute(Brush(strokes=list(strokes)), terrain, Run(**run)).elevation.astype(np.float64)


def stroke(tool: str = "raise", **changes: Any) -> dict[str, Any]:
    return {"tool": tool, "points": LINE, "radius": 60.0, "strength": 10.0, **changes}


def flat(size: int = 45, spacing: float = 10.0, height: float = 0.0) -> Heightfield:
    return Heightfield(np.full((size, size), height), spacing)


def distance(terrain: Heightfield, line: list[list[float]]) -> np.ndarray:
    """Return the distance to a line by searching along it."""
    x, y = terrain.origin
    east = x + np.arange(terrain.shape[1]) * terrain.spacing
    north = y - np.arange(terrain.shape[0]) * terrain.spacing
    share = np.linspace(0, 1, 401)[:, None]
    edges = zip(np.array(line[:-1]), np.array(line[1:]), strict=True)
    dots = np.concatenate([a + share * (b - a) for a, b in edges])
    nearest = np.full(terrain.shape, np.inf)
    for px, py in dots:
        nearest = np.minimum(nearest, (east[None, :] - px) ** 2 + (north[:, None] - py) ** 2)
    return np.sqrt(nearest)


@pytest.mark.parametrize(("tool", "sign"), [("raise", 1.0), ("lower", -1.0)])
def test_raise_and_lower_follow_the_distance_to_the_line(tool: str, sign: float) -> None:
    ground = flat()
    told = painted(ground, stroke(tool, hardness=0.5))
    t = np.clip((distance(ground, LINE) - 30.0) / 30.0, 0, 1)
    assert np.allclose(told, sign * 10.0 * (1 - t * t * (3 - 2 * t)), atol=0.02)
    assert np.abs(told).max() == 10.0


def test_recording_more_points_changes_nothing() -> None:
    share = np.linspace(0, 1, 37)[:, None]
    a, b, c = (np.array(p) for p in LINE)
    dense = np.concatenate([a + share * (b - a), b + share * (c - b)]).tolist()
    ground = rough_terrain((45, 45))
    for tool in ("raise", "smooth", "flatten"):
        few = stroke(tool, strength=0.9)
        gap = painted(ground, few) - painted(ground, {**few, "points": dense})
        assert np.abs(gap).max() < 0.02, tool


def test_a_line_that_crosses_itself_does_not_pile_up() -> None:
    cross = [[100.0, 100.0], [300.0, 300.0], [300.0, 100.0], [100.0, 300.0]]
    assert painted(flat(), stroke(points=cross)).max() == 10.0


def test_strokes_apply_in_order() -> None:
    up, level = stroke(), stroke("flatten", strength=1.0, height=3.0, radius=200.0, hardness=1.0)
    assert painted(flat(), up, level)[22, 22] == 3.0
    assert painted(flat(), level, up).max() == 13.0
    twice = painted(flat(), up, up)
    assert np.array_equal(twice, 2 * painted(flat(), up))


def test_flatten_is_exact_and_takes_the_height_where_it_begins() -> None:
    ground = rough_terrain((45, 45))
    told = painted(ground, stroke("flatten", strength=1.0, hardness=1.0))
    begin = float(ground.elevation[44 - 15, 10])
    inside = distance(ground, LINE) < 59.0
    assert (told[inside] == begin).all()
    outside = distance(ground, LINE) > 61.0
    assert np.array_equal(told[outside], ground.elevation[outside])


def test_smoothing_damps_waves_as_diffusion_does() -> None:
    spacing, radius, length = 5.0, 300.0, 120.0
    x = np.arange(201) * spacing
    ground = Heightfield(np.tile(500 + 10 * np.cos(2 * np.pi * x / length), (201, 1)), spacing)
    how = {"tool": "smooth", "points": [[500.0, 500.0]], "radius": radius, "hardness": 1.0}
    for strength in (0.1, 0.2):
        told = painted(ground, {**how, "strength": strength})
        deviation = strength * radius / 2
        left = math.exp(-0.5 * (2 * np.pi / length * deviation) ** 2)
        assert np.ptp(told[100, 80:121]) / 20 == pytest.approx(left, rel=0.06)


def test_smoothing_keeps_the_volume_and_stays_within_its_brush() -> None:
    ground = rough_terrain((65, 65))
    told = painted(ground, stroke("smooth", strength=1.0, radius=120.0))
    before = ground.elevation.astype(np.float64)
    assert told.sum() == pytest.approx(before.sum(), abs=1e-4 * np.abs(before).sum())
    assert told.max() <= before.max() + 1e-3
    far = distance(ground, LINE) > 121.0
    assert np.array_equal(told[far], before[far])
    near = distance(ground, LINE) < 30.0
    roughness = [np.diff(height, axis=1)[near[:, 1:]].std() for height in (told, before)]
    assert roughness[0] < 0.3 * roughness[1]


@pytest.mark.parametrize("tool", ["raise", "smooth", "flatten"])
def test_twice_the_samples_give_the_same_ground(tool: str) -> None:
    results = []
    for spacing, step in ((10.0, 1), (5.0, 2)):
        n = int(440 / spacing) + 1
        y, x = np.indices((n, n)) * spacing
        ground = Heightfield(30 * np.sin(x / 40) * np.cos(y / 50), spacing)
        strength = 10.0 if tool == "raise" else 0.6
        results.append(painted(ground, stroke(tool, strength=strength))[::step, ::step])
    gap = np.abs(results[0] - results[1])
    assert gap.max() < 0.6
    assert gap.mean() < 0.05


def test_a_tile_equals_the_whole() -> None:
    place = (1e6, 2e6)
    line = [[x + place[0], y + place[1]] for x, y in LINE]
    whole = rough_terrain((60, 60), 7.3, origin=(place[0], place[1] + 59 * 7.3))
    strokes = [stroke(points=line), stroke("flatten", points=line, strength=0.7, height=9.0)]
    tile = crop(whole, 17, 9, 21, 30)
    expected = painted(whole, *strokes)[17:38, 9:39]
    assert np.array_equal(painted(tile, *strokes, world=whole.grid), expected)
    assert not np.array_equal(expected, whole.elevation[17:38, 9:39])


def test_device_and_reference_agree_over_a_long_scribble() -> None:
    random = np.random.default_rng(4)
    scribble = (200 + np.cumsum(random.normal(0, 12, (120, 2)), axis=0)).tolist()
    ground = rough_terrain((61, 77), 6.1)
    strokes = [
        stroke(points=scribble, hardness=h, radius=r, strength=s, tool=t)
        for t, h, r, s in (
            ("raise", 0.0, 25.0, 7.0),
            ("smooth", 0.4, 90.0, 1.0),
            ("lower", 1.0, 3.0, 2.0),
            ("flatten", 0.2, 40.0, 0.5),
        )
    ]
    device, reference = painted(ground, *strokes), painted(ground, *strokes, device="numpy")
    assert np.array_equal(device, reference)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"radius": 0.0}, "stroke 2: radius = 0.0: must be 0 < radius <= 1e\\+06 m"),
        ({"radius": math.nan}, "stroke 2: radius = nan"),
        ({"radius": 1e-300}, "radius = 1e-300: must be at least 0.001 m"),
        ({"points": []}, "stroke 2: points.*at least one point"),
        ({"points": [[1.0, math.nan]]}, "stroke 2: points.*point 1 must be"),
        ({"points": [[1.0, 2.0], [3.0]]}, "stroke 2: points.*point 2 must be"),
        ({"points": [[1.0, 2.0]] * 100_001}, "100001 points > 100000"),
        ({"tool": "dig"}, "stroke 2: tool = 'dig'"),
        ({"tool": "smooth", "strength": 3.0}, "strength = 3: must be 0 <= strength <= 1"),
        ({"height": 3.0}, "height = 3: is for tool = 'flatten' only"),
        ({"colour": 3.0}, "stroke 2: unknown parameter 'colour'"),
    ],
)
def test_wrong_strokes_are_refused_by_number(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as told:
        Brush(strokes=[stroke(), stroke(**wrong)])
    assert "strokes" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_stroke_beside_the_terrain_is_refused_unless_it_is_a_tile() -> None:
    away = stroke(points=[[9000.0, 10.0]])
    with pytest.raises(InputError, match=r"stroke 2 at \(9000, 10\) lies beside the terrain"):
        painted(flat(), stroke(), away)
    assert not painted(flat(), away, world=Grid((2000, 2000), 10.0)).any()
    with pytest.raises(InputError, match="give it a height"):
        painted(flat(), stroke("flatten", strength=1.0, points=[[-20.0, 10.0]]))


def test_smoothing_that_would_take_for_ever_is_refused() -> None:
    with pytest.raises(ParameterError, match="sweeps at 0.01 m spacing"):
        painted(
            Heightfield(np.zeros((9, 9)), 0.01),
            stroke("smooth", points=[[0.0, 0.0]], radius=900.0, strength=1.0),
        )
