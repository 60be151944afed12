import numpy as np
import pytest

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.scaling import spectral_slope, variogram_hurst


@pytest.mark.parametrize("hurst", [0.5, 0.7, 0.9])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fractal_gives_back_its_exponent(fractal, hurst, seed):
    z = fractal(hurst, seed)
    beta2, excess = spectral_slope(z)
    assert variogram_hurst(z) == pytest.approx(hurst, abs=0.1)
    assert beta2 == pytest.approx(2 * hurst + 2, abs=0.3)
    assert abs(excess) < 0.1


def test_white_noise_has_a_flat_spectrum():
    noise = np.random.default_rng(1).standard_normal((256, 256))
    assert spectral_slope(noise)[0] == pytest.approx(0.0, abs=0.3)
    assert variogram_hurst(noise) == pytest.approx(0.0, abs=0.01)


def test_exponents_do_not_see_tilt_height_or_the_shape_of_the_map(fractal):
    z = fractal(0.7, 4)[:160]
    beta2, excess = spectral_slope(z)
    tilted = 7 * z + np.indices(z.shape)[0] * 300.0
    assert spectral_slope(tilted) == pytest.approx((beta2, excess), abs=1e-6)
    assert spectral_slope(z.T) == pytest.approx((beta2, excess), abs=1e-6)
    assert beta2 == pytest.approx(3.4, abs=0.4)


def test_grain_raises_and_smoothing_lowers_the_excess(fractal):
    z = fractal(0.9, 1)
    plain = spectral_slope(z)[1]
    noise = np.random.default_rng(2).standard_normal(z.shape)
    grain = [spectral_slope(z + height * noise)[1] for height in (2, 8, 32)]
    smooth = (np.roll(z, 1, 0) + 2 * z + np.roll(z, -1, 0))[1:-1, 1:-1] / 4
    smooth = (np.roll(smooth, 1, 1) + 2 * smooth + np.roll(smooth, -1, 1))[1:-1, 1:-1] / 4
    assert [plain, *grain] == sorted([plain, *grain])
    assert grain[-1] > 0.35
    assert spectral_slope(smooth)[1] < plain - 0.5


@pytest.mark.parametrize("z", [np.zeros((64, 64)), np.indices((64, 64))[1] * 3.0])
def test_planes_have_no_spectrum(z):
    with pytest.raises(NotMeasured):
        spectral_slope(z)
