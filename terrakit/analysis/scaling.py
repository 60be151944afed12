"""Yardsticks of scale: how roughness passes from large forms to small ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.relief import Heights, detrended

LONGEST_WAVE = 0.25
"""Longest wave of the spectrum's fit, as a share of the shorter side."""
SHORTEST_WAVE = 4.0
"""Shortest wave of the fit (cells): below it lie smoothing, interpolation and grain."""
GRAIN = 0.4
"""Frequency (cycles per cell) from which on waves are of the finest band, which ends at 0.5."""
ANNULI = 24
LAGS = (1, 2, 4, 8, 16)


def spectral_slope(elevation: Heights) -> tuple[float, float]:
    """Return (beta2, nyquist_excess) of the radially averaged power spectrum P(k) ~ k^-beta2.

    The plane of best fit is taken away and a Hann window laid over the rest; P is averaged over
    annuli evenly spaced in log k, and the line is fitted from a quarter of the shorter side down
    to four cells. A surface of Hurst exponent H has beta2 = 2 H + 2. The excess is the
    mean of log10(P / fit) between 0.4 and 0.5 cycles per cell: above 0 grain, below 0 smoothing.

    References
    ----------
    Perron, Kirchner & Dietrich, "Spectral signatures of characteristic spatial scales and
    nonfractal structure in landscapes", JGR 2008, doi:10.1029/2007JF000866.
    """
    surface = detrended(elevation)
    if float(np.abs(surface).max()) <= 1e-9 * max(1.0, float(np.abs(elevation).max())):
        raise NotMeasured("the terrain is a plane")
    frequency, power = _radial_spectrum(surface)
    x, y = np.log10(frequency), np.log10(np.maximum(power, np.finfo(float).tiny))
    fitted = frequency <= 1 / SHORTEST_WAVE
    if np.count_nonzero(fitted) < 4:
        raise NotMeasured("the terrain is too small for a spectrum")
    slope, height = np.polyfit(x[fitted], y[fitted], 1)
    grain = frequency >= GRAIN
    excess = float(np.mean(y[grain] - (slope * x[grain] + height)))
    return -float(slope), excess


def variogram_hurst(elevation: Heights) -> float:
    """Return H of the variogram ``<(z(x + l) - z(x))^2> ~ l^(2 H)``.

    Squared differences along rows and columns at 1, 2, 4, 8 and 16 cells, while the lag is at
    most a quarter of the shorter side; a straight line through their logarithms.

    References
    ----------
    Mark & Aronson, "Scale-dependent fractal dimensions of topographic surfaces", 1984.
    """
    lags = [lag for lag in LAGS if 4 * lag <= min(elevation.shape)]
    variogram = np.array(
        [
            np.mean(np.square(elevation[lag:] - elevation[:-lag]))
            + np.mean(np.square(elevation[:, lag:] - elevation[:, :-lag]))
            for lag in lags
        ]
    )
    if not np.all(variogram > 0):
        raise NotMeasured("the terrain is flat")
    return float(np.polyfit(np.log(lags), np.log(variogram), 1)[0]) / 2


def _radial_spectrum(surface: Heights) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequency (cycles per cell) and mean power of each annulus that holds any wave."""
    rows, columns = surface.shape
    window = np.hanning(rows)[:, None] * np.hanning(columns)[None, :]
    power = np.square(np.abs(np.fft.fft2(surface * window))).ravel()
    frequency = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.fftfreq(columns)[None, :]).ravel()
    lowest = 1 / (LONGEST_WAVE * min(rows, columns))
    edges = np.geomspace(lowest, 0.5, ANNULI + 1)
    annulus = np.digitize(frequency, edges)
    inside = (annulus >= 1) & (annulus <= ANNULI)
    count = np.bincount(annulus[inside], minlength=ANNULI + 1)
    held = count > 0
    totals = (
        np.bincount(annulus[inside], weights=w[inside], minlength=ANNULI + 1)[held]
        for w in (np.log(np.where(frequency > 0, frequency, 1.0)), power)
    )
    log_frequency, mean_power = (total / count[held] for total in totals)
    return np.exp(log_frequency), mean_power
