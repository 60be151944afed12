"""The curve goes through its points, never beyond them, and keeps pits where they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from terrakit import Heightfield, ParameterError, Run
from terrakit.execute import execute
from terrakit.testing.subjects import rough_terrain
from terrakit_filters.height_curve import HeightCurve, slopes_at

Numbers = NDArray[np.float64]
POINTS = [
    [-300.0, -500.0],
    [0.0, 0.0],
    [100.0, 20.0],
    [220.0, 60.0],
    [300.0, 700.0],
    [500.0, 710.0],
]


def curved(
    z: object, points: list[list[float]], device: str | None = "numpy", **more: object
) -> Numbers:
    heights = np.atleast_2d(np.asarray(z, dtype=np.float32))
    operator = HeightCurve(points=points, **more)
    result = execute(operator, Heightfield(heights, 10.0), Run(0, device))
    return np.asarray(result.elevation, dtype=np.float64)[0 if np.ndim(z) == 1 else slice(None)]


def pits(z: Numbers) -> NDArray[np.bool_]:
    """Return which inner samples have no lower or equal neighbour among eight."""
    rows, cols = z.shape
    inner = z[1:-1, 1:-1]
    around = [
        z[1 + i : rows - 1 + i, 1 + j : cols - 1 + j]
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
        if i or j
    ]
    return np.all([inner < other for other in around], axis=0)


points_lists = st.lists(
    st.tuples(st.integers(-3000, 3000), st.integers(-3000, 3000)),
    min_size=2,
    max_size=12,
    unique_by=lambda point: point[0],
).map(lambda points: [[float(x), float(y)] for x, y in sorted(points)])


@given(points_lists)
@settings(max_examples=60, deadline=None)
def test_it_goes_through_its_points_and_never_overshoots(points: list[list[float]]) -> None:
    x, y = (np.array([p[axis] for p in points]) for axis in (0, 1))
    assert np.array_equal(curved(x, points), y)
    for k in range(len(x) - 1):
        z = curved(np.linspace(x[k], x[k + 1], 65), points)
        assert min(y[k], y[k + 1]) <= z.min()
        assert z.max() <= max(y[k], y[k + 1])
        assert (np.diff(z) * np.sign(y[k + 1] - y[k]) >= -2e-3).all()


@given(points_lists)
@settings(max_examples=60, deadline=None)
def test_slopes_obey_fritsch_and_carlson(points: list[list[float]]) -> None:
    x, y = ([p[axis] for p in points] for axis in (0, 1))
    slopes = slopes_at(x, y)
    for k, secant in enumerate(np.diff(y) / np.diff(x)):
        if secant == 0:
            assert slopes[k] == slopes[k + 1] == 0
        else:
            a, b = slopes[k] / secant, slopes[k + 1] / secant
            assert a >= 0
            assert b >= 0
            assert a * a + b * b <= 9 * (1 + 1e-9)


def test_near_the_other_monotone_cubic() -> None:
    """SciPy's has harmonic means for slopes (Butland): another curve with the same bounds."""
    from scipy.interpolate import PchipInterpolator

    x, y = (np.array([p[axis] for p in POINTS]) for axis in (0, 1))
    z = np.linspace(-300.0, 500.0, 801)
    ours, theirs = curved(z, POINTS), PchipInterpolator(x, y)(z)
    assert np.abs(ours - theirs).max() < 0.1 * np.ptp(y)
    assert np.abs(ours - theirs).max() > 0.001  # they do differ


def test_on_points_of_a_line_it_is_the_line() -> None:
    z = np.linspace(-100.0, 1100.0, 501)
    line = curved(z, [[0.0, 50.0], [300.0, 200.0], [1000.0, 550.0]])
    assert line == pytest.approx(50 + z / 2, abs=1e-3)


def test_slopes_do_not_jump_at_the_points() -> None:
    z = np.linspace(-290.0, 490.0, 7801)
    step = np.diff(curved(z, POINTS)) / 0.1
    assert np.abs(np.diff(step)).max() < 0.35  # 0.1 m apart; a kink here would be 7


def test_beyond_the_points() -> None:
    ends = np.array([-700.0, -300.0, 500.0, 900.0])
    x, y = ([p[axis] for p in POINTS] for axis in (0, 1))
    slopes = slopes_at(x, y)
    hold = curved(ends, POINTS, extrapolate="hold")
    assert hold.tolist() == [-500.0, -500.0, 710.0, 710.0]
    shift = curved(ends, POINTS, extrapolate="shift")
    assert shift.tolist() == [-900.0, -500.0, 710.0, 1110.0]
    linear = curved(ends, POINTS)
    assert linear == pytest.approx([-500 - 400 * slopes[0], -500, 710, 710 + 400 * slopes[-1]])


@pytest.mark.parametrize("device", ["numpy", None])
def test_a_rising_curve_keeps_order_and_pits(device: str | None) -> None:
    ground = rough_terrain((129, 129), relief=450.0).elevation
    result = curved(ground, POINTS, device, keep_order=True)
    z = ground.astype(np.float64)
    assert pits(z).sum() > 10
    assert np.array_equal(pits(z), pits(result))
    order = np.argsort(z, axis=None, kind="stable")
    assert (np.diff(result.ravel()[order]) >= -1e-3).all()
    assert not np.array_equal(z, result)


@pytest.mark.parametrize("preset", sorted(HeightCurve.presets))
def test_presets_keep_the_order_of_heights(preset: str) -> None:
    operator = HeightCurve.from_settings({"preset": preset, "keep_order": True}, "test")
    z = curved(
        np.linspace(-4500.0, 4500.0, 4001), operator.points, extrapolate=operator.extrapolate
    )
    assert (np.diff(z) > 0).all()


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"points": [[0.0, 0.0]]}, "points: 1 pairs; must be 2 to 64"),
        ({"points": [[float(k), 0.0] for k in range(65)]}, "65 pairs"),
        ({"points": [[0.0, 0.0], [1.0]]}, r"number 2 is \[1.0\]"),
        ({"points": [[0.0, 0.0], [0.0, 5.0]]}, "old heights 0, 0 must rise"),
        ({"points": [[0.0, 0.0], [-5.0, 5.0]]}, "sort them"),
        ({"points": [[0.0, 9.0], [5.0, 5.0]], "keep_order": True}, "new heights 9, 5 must rise"),
        ({"points": [[0.0, 0.0], [1.0, 1e9]]}, "within 1e6 m"),
        ({"points": [[0.0, 0.0], [1.0, float("nan")]]}, "points"),
        ({"points": "alpine"}, "points = 'alpine'"),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(wrong: dict[str, object], reason: str) -> None:
    with pytest.raises(ParameterError, match=reason) as refusal:
        HeightCurve(**wrong)
    assert "\n" not in str(refusal.value)
