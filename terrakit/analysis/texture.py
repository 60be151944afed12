"""Yardsticks of the finest scale: what a grid, a droplet or plain noise leaves on single cells."""

from __future__ import annotations

import numpy as np

from terrakit.analysis.bands import NotMeasured
from terrakit.analysis.relief import Heights, detrended, gradient

SPIKE_WINDOW = 7
"""Side (cells) of the window over which the local relief is taken."""


def spike_fraction(elevation: Heights) -> float:
    """Return the fraction of cells that stand out from all eight neighbours.

    A spike rises above the highest neighbour, or sinks below the lowest, by more than the local
    relief: the mean step |z_a - z_b| between cells that share an edge, over 7 x 7 cells. White
    noise of any amplitude has 0.027, Brownian noise (H = 0.5) 0.005.
    """
    centre = elevation[1:-1, 1:-1]
    highest = np.full_like(centre, -np.inf)
    lowest = np.full_like(centre, np.inf)
    rows, columns = elevation.shape
    for down in (0, 1, 2):
        for right in (0, 1, 2):
            if (down, right) != (1, 1):
                neighbour = elevation[down : rows - 2 + down, right : columns - 2 + right]
                np.maximum(highest, neighbour, out=highest)
                np.minimum(lowest, neighbour, out=lowest)
    sticks_out = np.maximum(centre - highest, lowest - centre)
    return float(np.mean(sticks_out > _mean_step(elevation)[1:-1, 1:-1]))


def checkerboard_energy(elevation: Heights) -> float:
    """Return the share of the finest energy that alternates along rows and columns at once.

    With the second difference D = (1, -2, 1) and its smooth twin S = (1, 2, 1), the energies are
    D_row D_col (the chessboard), D_row S_col and S_row D_col (stripes), and the answer
    is the first over the sum of the three: 1 for a chessboard, 0 for stripes, and 1/3 for white
    noise, which has the same energy (36 variances) in each.
    """

    def differ(z: Heights) -> Heights:
        return z[:-2] - 2 * z[1:-1] + z[2:]

    def smooth(z: Heights) -> Heights:
        return z[:-2] + 2 * z[1:-1] + z[2:]

    across, along = differ(elevation.T).T, smooth(elevation.T).T
    energies = [
        float(np.mean(np.square(part))) for part in (differ(across), smooth(across), differ(along))
    ]
    total = sum(energies)
    if total <= 1e-18 * float(np.square(elevation).mean()) or total == 0:
        raise NotMeasured("the terrain has no detail at the size of a cell")
    return energies[0] / total


def aspect_bias(elevation: Heights, spacing: float) -> tuple[float, float]:
    """Return the 4th and 8th harmonic of the aspects, as shares of all slope.

    ``b_m = |sum s exp(i m phi)| / sum s`` with s the slope and phi the aspect of every cell after
    the plane of best fit is taken away (a tilted tile has one aspect, which is no artefact).
    0 is every direction alike; 1 is a pyramid along the axes (m = 4).
    """
    east, north = gradient(detrended(elevation), spacing)
    slope = np.hypot(east, north)
    total = float(slope.sum())
    if total <= 1e-9 * slope.size:
        raise NotMeasured("the terrain is a plane")
    aspect = np.arctan2(north, east)
    fourth, eighth = (abs(complex(np.sum(slope * np.exp(1j * m * aspect)))) for m in (4, 8))
    return fourth / total, eighth / total


def _mean_step(elevation: Heights) -> Heights:
    """Return the mean height difference of adjacent cells (m) in the window around each cell."""
    vertical = np.pad(np.abs(np.diff(elevation, axis=0)), ((1, 1), (0, 0)), mode="edge")
    horizontal = np.pad(np.abs(np.diff(elevation, axis=1)), ((0, 0), (1, 1)), mode="edge")
    steps = (vertical[1:] + vertical[:-1] + horizontal[:, 1:] + horizontal[:, :-1]) / 4
    half = SPIKE_WINDOW // 2
    sums = np.pad(steps, half, mode="edge")
    for _ in range(2):  # rows, then columns
        upper = np.pad(np.cumsum(sums, axis=0), ((1, 0), (0, 0)))
        sums = (upper[SPIKE_WINDOW:] - upper[:-SPIKE_WINDOW]).T
    return sums / SPIKE_WINDOW**2
