import heapq

import numpy as np
import pytest

from terrakit.analysis import drainage
from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.drainage import Drainage, drain
from terrakit.routing import reference as routing


def priority_flood(z):
    """Barnes, Lehman & Mulla 2014, algorithm 1, as plainly as can be."""
    rows, columns = z.shape
    level = np.full(z.shape, np.inf)
    border = np.ones(z.shape, bool)
    border[1:-1, 1:-1] = False
    level[border] = z[border]
    queue = [(z[cell], cell) for cell in map(tuple, np.argwhere(border))]
    heapq.heapify(queue)
    while queue:
        height, (row, column) = heapq.heappop(queue)
        for i in range(max(row - 1, 0), min(row + 2, rows)):
            for j in range(max(column - 1, 0), min(column + 2, columns)):
                if np.isinf(level[i, j]):
                    level[i, j] = max(z[i, j], height)
                    heapq.heappush(queue, (level[i, j], (i, j)))
    return level


def network(receiver, **known):
    """A drainage of which only some properties are known."""
    size = len(receiver)
    given = {
        "area": np.ones(size, np.int32),
        "elevation": np.arange(size, dtype=float),
        "step": np.ones(size),
        "longest": np.ones(size),
        "pits": 0,
        "peaks": 0,
    }
    return Drainage(receiver=np.asarray(receiver, np.int32), **(given | known))


# --- pits -----------------------------------------------------------------------------------


@pytest.mark.parametrize("hurst", [0.0, 0.5, 0.9])
def test_pits_and_peaks_are_those_of_priority_flood(fractal, hurst):
    z = np.round(fractal(hurst, 5, 64)[:45])
    water = drain(z, 30.0)
    assert water.pits == np.count_nonzero(priority_flood(z) > z)
    assert water.peaks == np.count_nonzero(priority_flood(-z) > -z)


def test_a_bowl_is_one_pit_and_a_dome_none():
    row, column = np.indices((81, 101)) / 50 - [[[0.8]], [[1.0]]]
    bowl = 100 * np.maximum((row / 0.8) ** 2, column**2)  # every level line is a rectangle
    inside = 79 * 99 / bowl.size
    assert drainage.pit_fraction(drain(bowl, 10.0)) == pytest.approx(inside)
    assert drainage.pit_fraction(drain(-bowl, 10.0)) == 0.0
    assert drainage.updown_asymmetry(drain(-bowl, 10.0)) == pytest.approx(np.log10(79 * 99 + 1))


def test_upside_down_changes_the_sign_of_the_asymmetry(fractal, jacksboro):
    for z in (fractal(0.7, 1, 64), jacksboro[:100, :120]):
        upright, mirrored = drain(z, 30.0), drain(-z, 30.0)
        assert drainage.updown_asymmetry(mirrored) == pytest.approx(
            -drainage.updown_asymmetry(upright)
        )


def test_all_water_leaves_and_flows_down_the_filled_surface(fractal):
    z = np.round(fractal(0.3, 2, 96, relief=40.0))  # whole metres: full of flats
    water = drain(z, 30.0)
    cell = np.arange(z.size)
    ends = cell[water.receiver == cell]
    border = np.ones(z.shape, bool)
    border[1:-1, 1:-1] = False
    assert set(routing.follow(water.receiver)) <= set(cell[border.ravel()])
    assert border.ravel()[ends].all()
    assert water.area[ends].sum() == z.size
    level = priority_flood(z).ravel()
    assert (level[water.receiver] <= level).all()


def test_lengths_are_metres(fractal):
    z = fractal(0.7, 1, 64)
    near, far = drain(z, 10.0), drain(z, 40.0)
    np.testing.assert_allclose(far.longest, 4 * near.longest, rtol=1e-5)
    assert set(np.round(near.step, 3)) == {0.0, 10.0, 14.142}


# --- slope and area -------------------------------------------------------------------------


def test_a_profile_of_known_concavity_is_measured():
    size, theta = 4000, 0.45
    area = np.geomspace(3, 400, size).round().astype(np.int32)[::-1]  # cell 0 is the outlet
    step = np.r_[0.0, np.full(size - 1, 30.0)]
    elevation = np.cumsum(step * (area * 900.0) ** -theta)
    river = network(np.r_[0, np.arange(size - 1)], area=area, step=step, elevation=elevation)
    measured, r2 = drainage.slope_area(river, 30.0)
    assert measured == pytest.approx(theta, abs=0.01)
    assert r2 > 0.999


@pytest.mark.parametrize("theta", [0.3, 0.5])
def test_steady_stream_power_gives_back_its_concavity(fractal, theta):
    z, spacing = fractal(0.7, 3, 160), 30.0
    for _ in range(6):  # lay a profile of S ~ A^-theta over the rivers, until they stay put
        water = drain(z, spacing)
        rise = water.step * 40.0 * (water.area * spacing**2) ** -theta
        flat = np.zeros(z.size)
        for cells in routing.generations(water.receiver)[1:]:
            flat[cells] = flat[water.receiver[cells]] + rise[cells]
        z = flat.reshape(z.shape)
    water = drain(z, spacing)
    measured, r2 = drainage.slope_area(water, spacing)
    assert drainage.pit_fraction(water) == 0.0
    assert measured == pytest.approx(theta, abs=0.03)
    assert r2 > 0.99


def test_slope_area_does_not_depend_on_the_unit_of_length(jacksboro):
    theta, r2 = drainage.slope_area(drain(jacksboro, 83.0), 83.0)
    wide_theta, wide_r2 = drainage.slope_area(drain(3 * jacksboro, 249.0), 249.0)
    assert wide_theta == pytest.approx(theta, abs=0.03)
    assert wide_r2 == pytest.approx(r2, abs=0.03)


def test_too_few_rivers_have_no_slope_area():
    with pytest.raises(NotMeasured):
        drainage.slope_area(network([0, 0, 1, 2]), 1.0)


# --- Hack and Horton ------------------------------------------------------------------------


def test_hack_exponent_of_an_exact_law():
    area = np.arange(1, 5000, dtype=np.int32)
    river = network(np.r_[0, np.arange(4998)], area=area, longest=3.0 * area**0.57)
    assert drainage.hack_exponent(river) == pytest.approx(0.57, abs=1e-6)


def test_horton_ratios_of_a_tree_that_forks_by_three():
    depth, ratio = 6, 3
    size = (ratio**depth - 1) // (ratio - 1)
    cell = np.arange(size)
    receiver = np.maximum(cell - 1, 0) // ratio
    level = np.repeat(np.arange(depth), ratio ** np.arange(depth))
    order = depth - level
    area = (20 * 4.0 ** (order - 1)).astype(np.int32)
    tree = network(receiver, area=area, step=10 * 2.0**order)
    assert drainage.horton_ratios(tree) == pytest.approx((3.0, 4.0, 2.0))


def test_a_single_river_has_no_ratios():
    river = network(np.r_[0, np.arange(400)], area=np.arange(401, 0, -1, dtype=np.int32))
    with pytest.raises(NotMeasured, match="branch"):
        drainage.horton_ratios(river)
