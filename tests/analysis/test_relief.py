import numpy as np
import pytest

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.relief import (
    detrended,
    gradient,
    hypsometric_integral,
    steepest_slope,
)


def test_gradient_points_east_and_north_in_metres_per_metre():
    row, column = np.indices((40, 50))
    east, north = gradient(0.3 * 5.0 * column - 0.2 * 5.0 * row, 5.0)
    np.testing.assert_allclose(east, 0.3)
    np.testing.assert_allclose(north, 0.2)


def test_a_cone_has_its_angle_and_a_third_of_its_block(cone):
    assert steepest_slope(cone, 10.0) == pytest.approx(30.0, abs=0.1)
    row, column = np.indices(cone.shape) - 63.5
    inside = np.where(np.hypot(row, column) < 63.5, cone, -np.inf)
    disc = inside[np.isfinite(inside)].reshape(1, -1)
    assert hypsometric_integral(disc) == pytest.approx(1 / 3, abs=0.01)


def test_halving_the_spacing_doubles_the_gradient(cone):
    steep = np.tan(np.radians(steepest_slope(cone, 5.0)))
    assert steep == pytest.approx(2 * np.tan(np.radians(steepest_slope(cone, 10.0))))


def test_flat_ground_has_no_hypsometry():
    with pytest.raises(NotMeasured, match="flat"):
        hypsometric_integral(np.zeros((40, 40)))


def test_detrending_equals_least_squares():
    z = np.random.default_rng(3).standard_normal((33, 47)).cumsum(axis=0)
    row, column = np.indices(z.shape)
    design = np.stack([np.ones(z.size), row.ravel(), column.ravel()], axis=1)
    fitted, *_ = np.linalg.lstsq(design, z.ravel(), rcond=None)
    np.testing.assert_allclose(detrended(z), z - (design @ fitted).reshape(z.shape), atol=1e-10)
