import numpy as np
import pytest

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.texture import aspect_bias, checkerboard_energy, spike_fraction


def checkers(shape):
    row, column = np.indices(shape)
    return ((row + column) % 2).astype(float)


# --- checkerboard ---------------------------------------------------------------------------


def test_white_noise_shares_its_energy_evenly():
    noise = np.random.default_rng(1).standard_normal((300, 400))
    assert checkerboard_energy(noise) == pytest.approx(1 / 3, abs=0.01)


def test_a_chessboard_is_all_checkerboard_and_stripes_are_none():
    board = checkers((64, 80))
    stripes = np.indices(board.shape)[0] % 2 * 1.0
    assert checkerboard_energy(board) == pytest.approx(1.0)
    assert checkerboard_energy(stripes) == pytest.approx(0.0, abs=1e-12)


def test_checkerboard_does_not_see_tilt_size_or_turns(fractal):
    z = fractal(0.7, 1, 128)
    value = checkerboard_energy(z)
    tilted = 5 * z + np.indices(z.shape)[1] * 20.0
    assert checkerboard_energy(tilted) == pytest.approx(value)
    assert checkerboard_energy(np.rot90(z)) == pytest.approx(value)


def test_more_chessboard_measures_more(jacksboro):
    board = checkers(jacksboro.shape)
    values = [checkerboard_energy(jacksboro + height * board) for height in (0, 2, 4, 8, 16)]
    assert values == sorted(values)
    assert values[0] < 0.08
    assert values[-1] > 0.18


def test_a_plane_has_no_fine_detail():
    with pytest.raises(NotMeasured):
        checkerboard_energy(np.indices((64, 64))[0] * 2.5)


# --- spikes ---------------------------------------------------------------------------------


def test_each_lone_spike_and_hole_is_counted_once():
    row, column = np.indices((100, 120))
    z = 3.0 * row + 2.0 * column
    z[10:90:10, 10:110:10] += 200.0
    z[15:90:10, 15:110:10] -= 200.0
    assert spike_fraction(z) == pytest.approx((80 + 80) / (98 * 118))


def test_smooth_ground_has_no_spikes(cone):
    assert spike_fraction(cone) == 0.0


def test_spikes_of_noise_do_not_depend_on_its_height():
    noise = np.random.default_rng(1).standard_normal((300, 400))
    assert spike_fraction(noise) == spike_fraction(1024 * noise) == pytest.approx(0.027, abs=0.002)


def test_more_spikes_measure_more(jacksboro):
    where = np.random.default_rng(1).random(jacksboro.shape)
    values = [
        spike_fraction(jacksboro + 100 * (where < share)) for share in (0, 0.002, 0.005, 0.02)
    ]
    assert values == sorted(values)
    assert values[0] < 2e-4
    assert values[-1] > 0.01


# --- aspects --------------------------------------------------------------------------------


def test_a_dome_faces_everywhere():
    row, column = np.indices((128, 128)) - 63.5
    m4, m8 = aspect_bias(100 * np.exp(-(row**2 + column**2) / (2 * 15**2)), 10.0)
    assert m4 < 2e-3
    assert m8 < 2e-3


def test_a_cone_faces_everywhere(cone):
    row, column = np.indices(cone.shape) - 63.5
    ring = np.where(np.hypot(row, column) < 60, cone, cone[63, 3])
    m4, m8 = aspect_bias(ring, 10.0)
    assert m4 < 0.02  # its foot is cut out of squares
    assert m8 < 0.02


def test_a_pyramid_faces_four_ways_and_an_octagon_eight():
    row, column = np.indices((128, 128)) - 63.5
    pyramid = -np.maximum(np.abs(row), np.abs(column))
    m4, m8 = aspect_bias(pyramid, 1.0)
    assert m4 > 0.95
    octagon = np.minimum(pyramid, -(np.abs(row) + np.abs(column)) / np.sqrt(2))
    m4, m8 = aspect_bias(octagon, 1.0)
    assert m4 < 0.2  # a square map has more of the diagonal faces
    assert m8 > 0.9


def test_a_tilt_is_no_bias(fractal):
    z = fractal(0.7, 1, 128)
    tilted = z + np.indices(z.shape)[1] * 40.0
    assert aspect_bias(tilted, 30.0) == pytest.approx(aspect_bias(z, 30.0))


def test_more_streaks_measure_more(jacksboro):
    streaks = np.random.default_rng(1).standard_normal(jacksboro.shape[0])[:, None]
    m4 = [aspect_bias(jacksboro + height * streaks, 83.0)[0] for height in (15, 30, 60)]
    assert m4 == sorted(m4)
    assert aspect_bias(jacksboro, 83.0)[0] < 0.06
    assert m4[1] > 0.12


def test_a_plane_has_no_aspects():
    with pytest.raises(NotMeasured, match="plane"):
        aspect_bias(np.indices((64, 64))[0] * 2.5, 1.0)
