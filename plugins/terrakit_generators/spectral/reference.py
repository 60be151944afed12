"""Spectral synthesis in NumPy: the waves, for every device, and the oracle of ``spectral.cl``."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import check_cancelled, exact

F = np.float32
Floats = NDArray[np.float32]


def spectrum(
    most: int,
    band: tuple[float, float],
    exponent: float,
    squeeze: tuple[float, float, float],
    words: tuple[int, int],
) -> Floats:
    """Return the waves of the upper half-plane, with the height 1 where ``|k|`` is 1.

    Parameters
    ----------
    most
        Largest wave number: waves of the shortest length that there are in a period.
    band
        Least and largest length of the wave vector.
    exponent
        The Hurst exponent H: heights go as ``|k|^-(H + 1)``.
    squeeze
        Coefficients of kx^2, kx ky and ky^2 in the squared length of the wave vector.
    words
        Seed of the phases.

    Returns
    -------
    array of shape (most + 1, 2 most + 1, 2)
        Real and imaginary part by ky from 0 and kx from ``-most``.
    """
    ky, kx = np.meshgrid(np.arange(most + 1), np.arange(-most, most + 1), indexing="ij")
    length = squared_length(kx, ky, squeeze)
    whole = ((ky > 0) | (kx > 0)) & (length >= F(band[0] ** 2)) & (length <= F(band[1] ** 2))
    height = exact.power(np.where(whole, length, F(1)), -0.5 * (exponent + 1.0))
    height = np.where(whole, height, F(0))
    height[:, most] *= F(0.5)  # kx = 0 is met from both sides
    phase = exact.uniform(exact.hashed(words, kx, ky))
    return np.stack(
        (height * exact.sine(phase + F(0.25)), height * exact.sine(phase)), axis=-1
    ).astype(F)


def squared_length(
    kx: NDArray[np.int64], ky: NDArray[np.int64], squeeze: tuple[float, float, float]
) -> Floats:
    """Return the squared length of wave vectors, in which stretched directions count less."""
    x, y = kx.astype(F), ky.astype(F)
    length: Floats = F(squeeze[0]) * (x * x) + F(squeeze[1]) * (x * y) + F(squeeze[2]) * (y * y)
    return length


def deviation(
    most: int, band: tuple[float, float], exponent: float, squeeze: tuple[float, float, float]
) -> float:
    """Return the root mean square of the sum of all waves of these bounds."""
    ky, kx = np.meshgrid(np.arange(most + 1), np.arange(-most, most + 1), indexing="ij")
    length = squared_length(kx, ky, squeeze)
    whole = ((ky > 0) | (kx > 0)) & (length >= F(band[0] ** 2)) & (length <= F(band[1] ** 2))
    power = exact.power(length[whole], -(exponent + 1.0))
    return math.sqrt(0.5 * math.fsum(power.tolist()))  # exact, whatever the order


def turns(position: NDArray[np.uint64], most: int) -> Floats:
    """Return cosine and sine of 2 pi k u for k = 0 ... most, as two planes of rows of positions.

    Parameters
    ----------
    position
        Shares u of the period, in parts of 2^64.
    """
    waves = np.arange(most + 1, dtype=np.uint64)[:, None]
    phase = ((waves * position[None, :]) >> np.uint64(40)).astype(F) * F(2.0**-24)
    return np.stack((exact.sine(phase + F(0.25)), exact.sine(phase)))


def waves(waves: Floats, turn_x: Floats, turn_y: Floats, offset: float) -> Floats:
    """Return the sum of all waves at every row and column, plus the offset."""
    most = waves.shape[0] - 1
    cols, rows = turn_x.shape[2], turn_y.shape[2]
    real = np.zeros((most + 1, cols), dtype=F)
    imaginary = np.zeros((most + 1, cols), dtype=F)
    for kx in range(most + 1):
        check_cancelled()
        plus, minus = waves[:, most + kx, :, None], waves[:, most - kx, :, None]
        cosine, sine = turn_x[0, kx], turn_x[1, kx]
        real += (plus[:, 0] + minus[:, 0]) * cosine - (plus[:, 1] - minus[:, 1]) * sine
        imaginary += (plus[:, 1] + minus[:, 1]) * cosine + (plus[:, 0] - minus[:, 0]) * sine
    height = np.zeros((rows, cols), dtype=F)
    for ky in range(most + 1):
        check_cancelled()
        cosine, sine = turn_y[0, ky, :, None], turn_y[1, ky, :, None]
        height += cosine * real[ky] - sine * imaginary[ky]
    return F(offset) + height
