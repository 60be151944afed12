"""Yardsticks of relief: how the heights are spread, and how steep they get."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.analysis.bands import NotMeasured

Heights = NDArray[np.float64]


def gradient(elevation: Heights, spacing: float) -> tuple[Heights, Heights]:
    """Return the rise to the east and to the north (m/m) of every cell inside the border.

    Central differences over two cells, which one-cell noise does not blow up.
    """
    east = (elevation[1:-1, 2:] - elevation[1:-1, :-2]) / (2 * spacing)
    north = (elevation[:-2, 1:-1] - elevation[2:, 1:-1]) / (2 * spacing)
    return east, north


def detrended(elevation: Heights) -> Heights:
    """Return the heights without their plane of best fit (least squares)."""
    rows, columns = elevation.shape
    down = np.arange(rows) - (rows - 1) / 2
    right = np.arange(columns) - (columns - 1) / 2
    centred = elevation - elevation.mean()
    tilt_down = float(down @ centred.sum(axis=1)) / (columns * float(down @ down))
    tilt_right = float(centred.sum(axis=0) @ right) / (rows * float(right @ right))
    plane: Heights = tilt_down * down[:, None] + tilt_right * right[None, :]
    detrended_heights: Heights = centred - plane
    return detrended_heights


def hypsometric_integral(elevation: Heights) -> float:
    """Return (mean - lowest) / (highest - lowest), the area under the hypsometric curve.

    References
    ----------
    Strahler, "Hypsometric (area-altitude) analysis of erosional topography", 1952; the
    elevation-relief form of Pike & Wilson 1971.
    """
    low, high = float(elevation.min()), float(elevation.max())
    if low == high:
        raise NotMeasured("the terrain is flat")
    return (float(elevation.mean()) - low) / (high - low)


def steepest_slope(elevation: Heights, spacing: float) -> float:
    """Return the angle (degrees) of the steepest cell, by central differences."""
    east, north = gradient(elevation, spacing)
    return float(np.degrees(np.arctan(np.hypot(east, north).max())))
