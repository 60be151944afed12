"""Measures how rough a terrain is, and how much each halving of the spacing tells anew.

Sums are of whole numbers and therefore the same in any order, on any machine.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrakit.compute import exact
from terrakit.heightfield import Heightfield

Numbers = NDArray[np.float64]
FINENESS = 20
"""Bits in which the largest residual is counted."""
REACH = 3
"""Samples around a point that its guess depends on, at a stride of one."""
LAGS = (1, 2, 4, 8)
DIAMOND = (
    ((-1, -1), (-1, 1), (1, -1), (1, 1)),
    ((-1, -3), (-1, 3), (1, -3), (1, 3), (-3, -1), (-3, 1), (3, -1), (3, 1)),
    ((-3, -3), (-3, 3), (3, -3), (3, 3)),
)
"""Rings of points around the centre of a cell, in halves of its side: near, further and far."""
SQUARE = (
    ((-1, 0), (1, 0), (0, -1), (0, 1)),
    ((-1, -2), (-1, 2), (1, -2), (1, 2), (-2, -1), (-2, 1), (2, -1), (2, 1)),
    ((-3, 0), (3, 0), (0, -3), (0, 3)),
)
"""The same around the middle of an edge: turned by 45 degrees."""
FALLOFF_LIMIT = 2.0
"""Fastest decay of innovations that is believed."""


@dataclass(frozen=True)
class Innovation:
    """What was measured of a terrain.

    Parameters
    ----------
    spacing
        Distance between its samples, metres.
    hurst_exponent
        H of its variogram ``mean |z(x + l) - z(x)|^2 ~ l^2H`` over lags of 1, 2, 4 and 8 samples.
    sigma_diamond, sigma_square
        Root mean square of what the samples tell beyond a guess from every second one, metres, for
        the centres of cells and for the middles of edges.
    falloff_diamond, falloff_square
        log2 of the same at twice the spacing over the same here: what each halving of the spacing
        tells shrinks by 2^-falloff.
    """

    spacing: float
    hurst_exponent: float
    sigma_diamond: float
    sigma_square: float
    falloff_diamond: float
    falloff_square: float

    @property
    def is_flat(self) -> bool:
        """Whether there is nothing that could go on in finer detail."""
        return self.sigma_diamond == 0 and self.sigma_square == 0

    def deviations(self, level: int, falloff: float | None = None) -> tuple[float, float]:
        """Return the deviation of centres and edges when the samples double once more.

        Parameters
        ----------
        level
            How often they were doubled before.
        falloff
            In place of the measured ones.
        """
        steps = np.float32(level + 1)
        result = []
        for sigma, measured in (
            (self.sigma_diamond, self.falloff_diamond),
            (self.sigma_square, self.falloff_square),
        ):
            exponent = np.float32(measured if falloff is None else falloff)
            shrunk = exact.exp2(np.array([-exponent * steps], dtype=np.float32))
            result.append(sigma * float(shrunk[0]))
        return result[0], result[1]


def measure(terrain: Heightfield, *, is_mean: bool = False) -> Innovation:
    """Return the innovations of a terrain of 9 x 9 samples or more.

    Every sample is guessed from its neighbours by the stencils that refine: from the corners of
    the cell of twice the spacing of which it is the centre, and from the ends and centres around
    the edge of which it is the middle. Water and what was filled in is left out.

    Parameters
    ----------
    terrain
        The terrain; ``valid`` and ``water_depth`` are used if they are there.
    is_mean
        Whether guesses are means of the four nearest points (Miller 1986).
    """
    height = terrain.elevation.astype(np.float64)
    told = telling(terrain)
    sigmas = {
        stride: [
            _root_mean_square(residual, told, REACH * stride)
            for residual in residuals(height, stride, is_mean)
        ]
        for stride in (1, 2)
        if min(height.shape) >= 6 * stride + 3
    }
    hurst = variogram_exponent(height)
    falloffs = [hurst, hurst]
    if 2 in sigmas:
        for index, (fine, coarse) in enumerate(zip(sigmas[1], sigmas[2], strict=True)):
            if fine > 0 and coarse > 0:
                falloffs[index] = min(max(_log2(coarse / fine), 0.0), FALLOFF_LIMIT)
    return Innovation(terrain.spacing, hurst, *sigmas[1], *falloffs)


def residuals(height: Numbers, stride: int, is_mean: bool) -> tuple[Numbers, Numbers]:
    """Return what is not guessed as a centre and as an edge, of all but the margin of REACH."""
    margin = REACH * stride
    rows, cols = height.shape

    def at(south: int, east: int) -> Numbers:
        top, left = margin + south * stride, margin + east * stride
        return height[top : top + rows - 2 * margin, left : left + cols - 2 * margin]

    here = at(0, 0)
    results = []
    for rings in (DIAMOND, SQUARE):
        sums = []
        for ring in rings:
            total = np.zeros(here.shape)
            for place in ring:
                total += at(*place) - here
            sums.append(total)
        near, further, far = sums
        guess = 0.25 * near
        if not is_mean:
            guess = 0.3359375 * near - 0.0546875 * further + 0.0234375 * far
        results.append(-guess)
    return results[0], results[1]


def telling(terrain: Heightfield) -> NDArray[np.bool_]:
    """Return which samples are ground that was measured: neither water nor filled in."""
    told = np.ones(terrain.shape, dtype=bool)
    if "water_depth" in terrain:
        told &= terrain.layer("water_depth") <= 0
    if "valid" in terrain:
        told &= terrain.layer("valid") >= 0.5
    return told


def local_share(
    residual: tuple[Numbers, Numbers], told: NDArray[np.bool_], window: int, most: float
) -> NDArray[np.float32]:
    """Return how rough the ground around every sample is, of the whole: root mean squares.

    Parameters
    ----------
    residual
        Of :func:`residuals` at a stride of one.
    told
        Of :func:`telling`.
    window
        Samples a side of the square around a sample.
    most
        Largest share.
    """
    squares, _ = _squares(residual[1])
    known = _told_inside(told, REACH)
    squares = np.where(known, squares, 0)
    total, count = int(squares.sum(dtype=object)), int(known.sum())
    shape = told.shape
    if total == 0:
        return np.zeros(shape, dtype=np.float32)
    inside = _window_sums(squares, window), _window_sums(known.astype(np.int64), window)
    mean = inside[0] / np.maximum(inside[1], 1) / (total / count)
    share = np.minimum(np.sqrt(mean), most).astype(np.float32)
    return np.pad(share, REACH, mode="edge")


def variogram_exponent(height: Numbers) -> float:
    """Return H of the variogram over lags of 1, 2, 4 and 8 samples, 0 to 1."""
    lags = [lag for lag in LAGS if 2 * lag < min(height.shape)]
    logarithms = []
    for lag in lags:
        gaps = np.concatenate(
            [(height[lag:] - height[:-lag]).ravel(), (height[:, lag:] - height[:, :-lag]).ravel()]
        )
        squares, unit = _squares(gaps)
        mean = _sum(squares) * unit * unit / squares.size
        if mean == 0:
            return 0.5
        logarithms.append(_log2(mean))
    x = [_log2(lag) for lag in lags]
    middle, height_of_middle = sum(x) / len(x), sum(logarithms) / len(x)
    slope = sum((a - middle) * (b - height_of_middle) for a, b in zip(x, logarithms, strict=True))
    return min(max(0.5 * slope / sum((a - middle) ** 2 for a in x), 0.0), 1.0)


def _root_mean_square(residual: Numbers, told: NDArray[np.bool_], margin: int) -> float:
    squares, unit = _squares(residual)
    known = _told_inside(told, margin)
    squares = squares[known]
    return float(np.sqrt(_sum(squares) / squares.size)) * unit


def _told_inside(told: NDArray[np.bool_], margin: int) -> NDArray[np.bool_]:
    """Return for which points all samples within the margin tell; all points if for none."""
    inside = told.shape[0] - 2 * margin, told.shape[1] - 2 * margin
    if told.all():
        return np.ones(inside, dtype=bool)
    sums = _window_sums(told.astype(np.int64), 2 * margin + 1)
    known = sums[margin:-margin, margin:-margin] == (2 * margin + 1) ** 2
    return known if known.any() else np.ones(inside, dtype=bool)


def _squares(values: Numbers) -> tuple[NDArray[np.int64], float]:
    """Return squares as whole numbers, and the power of two of which the roots are counted."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest == 0:
        return np.zeros(values.shape, dtype=np.int64), 1.0
    unit = 2.0 ** (int(np.frexp(largest)[1]) - FINENESS)
    counted = np.rint(values / unit).astype(np.int64)
    return counted * counted, unit


def _sum(squares: NDArray[np.int64]) -> int:
    """Return a sum that no size of map overflows."""
    flat = squares.ravel()
    block = 2**22
    return sum(int(flat[k : k + block].sum()) for k in range(0, flat.size, block))


def _window_sums(values: NDArray[np.int64], window: int) -> NDArray[np.int64]:
    """Return the sum over a square around every value; it is smaller at the border."""
    half = window // 2
    for axis in (0, 1):
        count = values.shape[axis]
        totals = np.cumsum(values, axis=axis)
        totals = np.concatenate([np.zeros_like(totals.take([0], axis)), totals], axis)
        index = np.arange(count)
        last = np.minimum(index + half + 1, count)
        values = totals.take(last, axis) - totals.take(np.maximum(index - half, 0), axis)
    return values


def _log2(value: float) -> float:
    """Return a logarithm by the operations that are the same everywhere."""
    return float(exact.log2(np.array([value], dtype=np.float32))[0])
