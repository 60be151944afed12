"""Left of the line lies one terrain, right of it the other, and the seam is as wide as it says."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from terrakit import Grid, Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import crop, rough_terrain
from terrakit_filters.join import Join
from terrakit_filters.join.crossing import crossing

Numbers = NDArray[np.float64]
Points = list[list[float]]
GRID = Grid((81, 101), 10.0, (-500.0, 400.0))
FLAT = Heightfield.on_grid(GRID, np.zeros(GRID.shape))
BENT = [[-200.0, -500.0], [-100.0, 0.0], [150.0, 50.0], [100.0, 250.0], [300.0, 300.0]]


def joined(
    line: Points,
    transition: float = 0.0,
    wander: float = 0.0,
    device: str | None = "numpy",
    **more: object,
) -> Numbers:
    operator = Join(other=1.0, line=line, transition=transition, wander=wander, **more)
    return np.asarray(execute(operator, FLAT, Run(2, device)).elevation, dtype=np.float64)


def places() -> tuple[Numbers, Numbers]:
    return np.meshgrid(-500.0 + 10.0 * np.arange(101), 400.0 - 10.0 * np.arange(81))


def extended(line: Points, by: float = 1e5) -> Numbers:
    """Return the line with its ends far away."""
    p = np.array(line)
    first, last = p[0] - p[1], p[-1] - p[-2]
    ends = p[0] + first / np.hypot(*first) * by, p[-1] + last / np.hypot(*last) * by
    return np.array([ends[0], *p, ends[1]])


def distances(line: Points) -> Numbers:
    """Return the distance of every sample from the line, by brute force."""
    x, y = places()
    nearest = np.full(x.shape, np.inf)
    p = extended(line)
    for (ax, ay), (bx, by) in pairwise(p):
        ux, uy = bx - ax, by - ay
        t = np.clip(((x - ax) * ux + (y - ay) * uy) / (ux * ux + uy * uy), 0, 1)
        nearest = np.minimum(nearest, np.hypot(x - ax - t * ux, y - ay - t * uy))
    return nearest


def right_of(line: Points) -> NDArray[np.bool_]:
    """Return which samples lie right of a line, as the inside of a polygon that closes it."""
    p = extended(line)
    start = math.atan2(*(p[0] - p[1])[::-1])
    end = math.atan2(*(p[-1] - p[-2])[::-1])
    sweep = (start - end) % (2 * math.pi)  # clockwise along the right side is end -> start reversed
    turn = end - np.linspace(0.0, 2 * math.pi - sweep, 64)
    arc = 3e5 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    polygon = np.concatenate([p, arc])
    x, y = places()
    inside = np.zeros(x.shape, bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (ay > y) != (by > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x < ax + (y - ay) * (bx - ax) / (by - ay))
    return inside


def test_east_of_a_line_to_the_north_is_its_right() -> None:
    z = joined([[0.0, 0.0], [0.0, 10.0]])
    x, _ = places()
    assert (z[x < 0] == 0).all()
    assert (z[x > 0] == 1).all()
    assert np.array_equal(joined([[0.0, 10.0], [0.0, 0.0]])[x != 0], 1 - z[x != 0])


@pytest.mark.parametrize(
    "line",
    [
        BENT,
        BENT[::-1],
        [[-300.0, -300.0], [-100.0, 200.0], [100.0, 200.0], [300.0, -300.0]],
        [[-300.0, 0.0], [0.0, 0.0], [300.0, 0.0]],
        [[-300.0, 0.0], [0.0, 1e-4], [300.0, 0.0]],
        [[0.0, -300.0], [0.0, 5.0], [40.0, -290.0]],
        [[float(x), 40.0 * math.sin(x / 30.0)] for x in range(-400, 401, 20)],
    ],
    ids=["bent", "backwards", "arch", "straight", "nearly straight", "hairpin", "wave"],
)
def test_sides_and_distances_are_those_of_brute_force(line: Points) -> None:
    away = distances(line)
    side = right_of(line)
    clear = away > 0.5
    assert np.array_equal(joined(line)[clear] == 1.0, side[clear])
    t = np.clip(np.where(side, away, -away) / 160.0 + 0.5, 0, 1)
    expected = t**3 * (t * (6 * t - 15) + 10)
    assert joined(line, 160.0)[clear] == pytest.approx(expected[clear], abs=1e-3)


def test_beyond_the_transition_each_terrain_is_untouched() -> None:
    ground, other = rough_terrain((81, 101)), rough_terrain((81, 101), relief=90.0)
    line = [[300.0, 0.0], [600.0, 900.0]]
    operator = Join(other="other", line=line, transition=100.0, wander=0.0)
    result = execute(operator, ground, Run(2, "numpy", earlier={"other": other})).elevation
    y, x = np.mgrid[800.0:-1:-10.0, 0.0:1001.0:10.0]
    right = ((x - 300.0) * 900.0 - y * 300.0) / math.hypot(300.0, 900.0)
    assert np.array_equal(result[right < -50.1], ground.elevation[right < -50.1])
    assert np.array_equal(result[right > 50.1], other.elevation[right > 50.1])
    low, high = (f(ground.elevation, other.elevation) for f in (np.minimum, np.maximum))
    assert (result >= low - 1e-4).all()
    assert (result <= high + 1e-4).all()


def test_the_seam_strays_no_farther_than_it_may() -> None:
    line = [[0.0, 0.0], [30.0, 100.0]]
    straight, grown = joined(line), joined(line, wander=120.0, wavelength=200.0)
    moved = straight != grown
    assert moved.sum() > 100
    assert distances(line)[moved].max() <= 120.0
    other = joined(line, wander=120.0, wavelength=200.0, seed=1)
    assert not np.array_equal(grown, other)


def test_a_tile_is_a_part_of_the_whole_and_devices_agree() -> None:
    ground = rough_terrain((65, 65), origin=(1e6, 2e6))
    line = [[1e6 + 100.0, 2e6 - 700.0], [1e6 + 300.0, 2e6 - 300.0], [1e6 + 350.0, 2e6]]
    operator = Join(other=50.0, line=line, transition=90.0, wander=60.0, wavelength=150.0)
    whole = execute(operator, ground, Run(2, "numpy"))
    assert np.array_equal(whole.elevation, execute(operator, ground, Run(2)).elevation)
    part = execute(operator, crop(ground, 9, 14, 30, 33), Run(2, "numpy"))
    assert np.array_equal(part.elevation, whole.elevation[9:39, 14:47])


CROSSING = {
    "a loop": [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [5.0, -5.0]],
    "its end runs into it": [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [5.0, 9.0], [5.0, 8.0]],
    "its beginning runs into it": [[5.0, 5.0], [5.0, 6.0], [0.0, 6.0], [0.0, 0.0], [9.0, 0.0]],
    "both ends meet": [[0.0, 5.0], [0.0, 10.0], [10.0, 10.0], [9.0, 5.0], [8.0, 0.0]],
    "straight back": [[0.0, 0.0], [10.0, 0.0], [5.0, 0.0]],
    "back over itself": [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [-9.0, 9.0], [-9.0, 0.0], [-5.0, 0.0]],
}


@pytest.mark.parametrize("what", CROSSING)
def test_a_line_that_crosses_itself_is_refused(what: str) -> None:
    with pytest.raises(ParameterError, match="line: crosses itself at .* no left and right"):
        Join(other=0.0, line=CROSSING[what])


def test_lines_that_do_not_cross_are_taken() -> None:
    for line in (BENT, [[0.0, 0.0], [0.0, 9.0], [9.0, 9.0], [9.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]]):
        assert crossing([(x, y) for x, y in line]) is None


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ([[0.0, 0.0]], "1 points; must be 2 to 64"),
        ([], "0 points"),
        ([[0.0, 0.0], [0.0, 0.0]], "points 1 and 2 are both"),
        ([[0.0, 0.0], [1.0]], "point 2 is"),
        ([[0.0, 0.0], [1.0, float("inf")]], "line"),
        ([[0.0, 0.0], [1e12, 0.0]], "within 1e9 m"),
    ],
)
def test_what_is_no_line_is_refused(line: Points, reason: str) -> None:
    with pytest.raises(ParameterError, match=reason):
        Join(other=0.0, line=line)
