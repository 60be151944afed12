"""Heights through a curve: what lay at this height lies at that one."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar, Literal, Self

from pydantic import model_validator

from terrakit.formula import Formula, FormulaFilter, Number, Place, clamp, where
from terrakit.parameters import parameter

MOST_POINTS = 64


class HeightCurve(FormulaFilter):
    """Draw every height through a smooth curve that never overshoots its points.

    Between points (x_k, y_k) the curve is a cubic Hermite spline::

        y(t) = y_k + h t m_k + t^2 (3 D - 2 h m_k - h m_k+1) + t^3 (h m_k + h m_k+1 - 2 D)
        h = x_k+1 - x_k,  D = y_k+1 - y_k,  t = (x - x_k) / h

    whose slopes m are the means of the neighbouring secants, lowered as Fritsch and Carlson
    (1980) do: where (a, b) = (m_k, m_k+1) h / D lies outside of the circle of radius 3 it is
    brought back to it. So the curve rises where its points rise. Points that rise keep the order
    of heights, and with it every summit, pit and flow direction.

    References
    ----------
    F. N. Fritsch and R. E. Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numerical
    Analysis 17, 1980.
    """

    name = "height_curve"
    cites = ("Fritsch & Carlson 1980",)
    fields = 3
    trial: ClassVar = {"points": [[-50.0, -80.0], [0.0, 0.0], [40.0, 10.0], [90.0, 140.0]]}
    idle: ClassVar = {"points": [[0.0, 0.0], [1.0, 1.0]], "extrapolate": "shift"}

    points: list[list[float]] = parameter(
        [[0.0, 0.0], [1000.0, 300.0], [2000.0, 1100.0], [3000.0, 3000.0]],
        "Pairs [old height, new height]; the old ones rise.",
        unit="m",
    )
    extrapolate: Literal["linear", "shift", "hold"] = parameter(
        "linear",
        "Beyond the points: on with the slope at the end, with slope 1, or no further.",
    )
    keep_order: bool = parameter(
        False, "Whether to refuse points of which a higher one would become a lower one."
    )

    presets: ClassVar = {
        "alpine": {"points": [[0.0, 0.0], [1000.0, 300.0], [2000.0, 1100.0], [3000.0, 3000.0]]},
        "lowland": {"points": [[0.0, 0.0], [300.0, 220.0], [1000.0, 420.0], [3000.0, 700.0]]},
        "plateau": {
            "points": [
                [0.0, 0.0],
                [700.0, 120.0],
                [1000.0, 850.0],
                [1400.0, 960.0],
                [3000.0, 1150.0],
            ]
        },
        "shelf": {
            "points": [
                [-4000.0, -4000.0],
                [-700.0, -2500.0],
                [-250.0, -180.0],
                [0.0, 0.0],
                [1000.0, 1000.0],
            ],
            "extrapolate": "shift",
        },
    }

    @model_validator(mode="after")
    def _is_a_curve(self) -> Self:
        if not 2 <= len(self.points) <= MOST_POINTS:
            raise ValueError(f"points: {len(self.points)} pairs; must be 2 to {MOST_POINTS}")
        for number, point in enumerate(self.points, 1):
            if len(point) != 2:
                raise ValueError(f"points: number {number} is {point}; must be [old, new] in m")
            if not all(abs(value) <= 1e6 for value in point):
                raise ValueError(f"points: number {number} is {point}; must be within 1e6 m")
        for (x, y), (u, v) in pairwise(self.points):
            if not u - x >= 1e-3:
                raise ValueError(
                    f"points: old heights {x:g}, {u:g} must rise by at least 0.001 m; sort them"
                )
            if self.keep_order and not y < v:
                raise ValueError(
                    f"points: new heights {y:g}, {v:g} must rise to keep the order of heights; "
                    "raise the second or leave out keep_order"
                )
        return self

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the height on the curve."""
        if self.extrapolate == "shift" and all(x == y for x, y in self.points):
            return ground
        x, y = ([point[axis] for point in self.points] for axis in (0, 1))
        slopes = slopes_at(x, y)
        inside = _on_segments(ground, x, y, slopes)
        first, last = {"linear": (slopes[0], slopes[-1]), "shift": (1.0, 1.0), "hold": (0.0, 0.0)}[
            self.extrapolate
        ]
        below = y[0] + (ground - x[0]) * first
        above = y[-1] + (ground - x[-1]) * last
        return where(ground < x[0], below, where(ground < x[-1], inside, above))


def slopes_at(x: list[float], y: list[float]) -> list[float]:
    """Return the slopes of the monotone cubic at its points (Fritsch and Carlson 1980)."""
    secants = [(v - y0) / (u - x0) for x0, y0, u, v in zip(x, y, x[1:], y[1:], strict=False)]
    slopes = [secants[0]]
    for before, after in pairwise(secants):
        slopes.append(0.5 * (before + after) if before * after > 0 else 0.0)
    slopes.append(secants[-1])
    for k, secant in enumerate(secants):
        if secant == 0:
            slopes[k] = slopes[k + 1] = 0.0
            continue
        a, b = slopes[k] / secant, slopes[k + 1] / secant
        radius = math.sqrt(a * a + b * b)
        if radius > 3:
            slopes[k], slopes[k + 1] = 3 * a / radius * secant, 3 * b / radius * secant
    return slopes


def _on_segments(ground: Formula, x: list[float], y: list[float], slopes: list[float]) -> Formula:
    """Return the cubic of the segment in which the ground lies: its numbers are picked first."""
    segments = []
    for k in range(len(x) - 1):
        width, rise = x[k + 1] - x[k], y[k + 1] - y[k]
        start, end = slopes[k] * width, slopes[k + 1] * width
        segments.append(
            (
                x[k],
                1.0 / width,
                y[k],
                start,
                3 * rise - 2 * start - end,
                start + end - 2 * rise,
                min(y[k], y[k + 1]),
                max(y[k], y[k + 1]),
            )
        )
    chosen: list[Number] = list(segments[0])
    for segment in segments[1:]:
        beyond = ground >= segment[0]
        chosen = [where(beyond, new, old) for new, old in zip(segment, chosen, strict=True)]
    base, scale, c0, c1, c2, c3, low, high = chosen
    t = (ground - base) * scale
    return clamp(c0 + t * (c1 + t * (c2 + t * c3)), low, high)
