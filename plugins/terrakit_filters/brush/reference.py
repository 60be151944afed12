"""The brush in NumPy: the readable definition, and the oracle of ``brush.cl``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrakit.world import FINE
from terrakit_filters.brush.stroke import Segments

F = np.float32
Field = NDArray[np.float32]
FAR = F(1e30)
"""Squared distance where no segment was looked at."""


def cover(squared: Field, segments: Segments, chosen: slice, x: int, y: int) -> None:
    """Lower ``squared`` to the squared distance, in samples, to the nearest chosen segment.

    Parameters
    ----------
    squared
        Of a window of samples; changed in place.
    segments, chosen
        The line, and which of its segments count.
    x, y
        Place of the window's north-west sample, parts of a sample.
    """
    rows, cols = squared.shape
    px = x + np.arange(cols, dtype=np.int64) * FINE
    py = y - np.arange(rows, dtype=np.int64) * FINE
    for start, along in zip(segments.start[chosen], segments.along[chosen], strict=True):
        dx = ((px - start[0]).astype(F) * F(1 / FINE))[None, :]
        dy = ((py - start[1]).astype(F) * F(1 / FINE))[:, None]
        t = (dx * along[0] + dy * along[1]) * along[2]
        t = np.where(t < F(0), F(0), np.where(t > F(1), F(1), t))
        qx, qy = dx - t * along[0], dy - t * along[1]
        d = qx * qx + qy * qy
        squared[...] = np.where(d < squared, d, squared)


def weigh(squared: Field, inner: float, falloff: float) -> Field:
    """Return 1 up to ``inner`` samples from the line, falling smoothly to 0.

    Parameters
    ----------
    squared
        Squared distances, samples.
    inner
        Up to where the brush works in full, samples.
    falloff
        1 over the width of the edge, samples.
    """
    t = (np.sqrt(squared) - F(inner)) * F(falloff)
    t = np.where(t < F(0), F(0), np.where(t > F(1), F(1), t))
    weight: Field = F(1) - t * t * (F(3) - F(2) * t)
    return weight


def lift(height: Field, weight: Field, amount: float) -> Field:
    """Return heights raised by ``amount`` metres, where the weight is 1."""
    return height + F(amount) * weight


def level(height: Field, weight: Field, share: float, target: np.float32) -> Field:
    """Return heights drawn to ``target``; exactly that where weight and share are 1."""
    a = weight * F(share)
    drawn: Field = height * (F(1) - a) + target * a
    return drawn


def smooth(now: Field, before: Field, weight: Field, factors: tuple[float, float, float]) -> Field:
    """Return heights after one stage of masked diffusion.

    Parameters
    ----------
    now, before
        Heights after the last stage and after the one before it.
    weight
        Of the brush; between two samples their mean counts, and none if one is 0.
    factors
        Of ``now``, ``before`` and the flow (Meyer, Balsara & Aslam 2014, RKL1).
    """
    rows, cols = np.zeros_like(now), np.zeros_like(now)
    down = _conductance(weight[1:], weight[:-1]) * (now[1:] - now[:-1])
    rows[:-1] += down
    rows[1:] -= down
    right = _conductance(weight[:, 1:], weight[:, :-1]) * (now[:, 1:] - now[:, :-1])
    cols[:, :-1] += right
    cols[:, 1:] -= right
    after: Field = F(factors[0]) * now + F(factors[1]) * before + F(factors[2]) * (rows + cols)
    return after


def _conductance(here: Field, there: Field) -> Field:
    return np.where((here > F(0)) & (there > F(0)), F(0.5) * (here + there), F(0))
