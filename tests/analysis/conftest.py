"""Terrains of which something is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

Heights = NDArray[np.float64]


@pytest.fixture(scope="session")
def fractal() -> Callable[..., Heights]:
    """Spectral fBm, ``P(k) ~ k^-(2 H + 2)``, cut out of a periodic field of twice the size."""

    def synthesise(hurst: float, seed: int, size: int = 256, relief: float = 1000.0) -> Heights:
        draw = np.random.default_rng(seed).standard_normal((2 * size, 2 * size))
        wave = np.hypot(np.fft.fftfreq(2 * size)[:, None], np.fft.rfftfreq(2 * size)[None, :])
        wave[0, 0] = np.inf
        field = np.fft.irfft2(np.fft.rfft2(draw) * wave ** -(hurst + 1), s=draw.shape)
        tile = field[:size, :size]
        return (tile - tile.min()) / np.ptp(tile) * relief

    return synthesise


@pytest.fixture(scope="session")
def jacksboro() -> Heights:
    """The Jacksboro fault, Tennessee: 344 x 403 whole metres at 3 arc seconds (about 83 m)."""
    cbook = pytest.importorskip("matplotlib.cbook")
    with cbook.get_sample_data("jacksboro_fault_dem.npz") as sample:
        return sample["elevation"].astype(np.float64)


@pytest.fixture
def cone() -> Heights:
    """A cone of 30 degrees at 10 m a sample, whose tip is between the samples."""
    row, column = np.indices((128, 128)) - 63.5
    return -np.tan(np.radians(30)) * 10 * np.hypot(row, column)
