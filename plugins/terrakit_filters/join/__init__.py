"""Two terrains side by side: this one left of a line, another one right of it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar, Self

from pydantic import model_validator

from terrakit.formula import (
    Formula,
    FormulaFilter,
    Place,
    fbm,
    lerp,
    maximum,
    minimum,
    smoothstep,
    sqrt,
    where,
)
from terrakit.parameters import Seed, parameter
from terrakit.sources import Source
from terrakit_filters.join.crossing import Vector, crossing

MOST_POINTS = 64
NARROWEST = 1e-3
"""Metres of transition below which the seam is a step."""


class Join(FormulaFilter):
    """Join another terrain to this one along a line: left of it this one, right of it the other.

    Looking along the line from its first point to its last; beyond both it runs straight on. With
    d the distance from the line, positive to the right, and n noise of up to ``wander`` metres::

        z' = z + (other - z) smoothstep(-transition / 2, transition / 2, d + n)

    The line is followed exactly, so let it bend no tighter than the transition is wide: inside
    of a tighter bend the two halves of the transition meet in a crease.

    References
    ----------
    K. Perlin, "Improving noise", SIGGRAPH 2002, for the smooth step and the noise.
    """

    name = "join"
    cites = ("Perlin 2002",)
    fields = 5
    turning: ClassVar = None
    trial: ClassVar = {
        "other": {"use": "expression", "formula": "40*sin(x/60)*cos(y/80)"},
        "line": [[60.0, 0.0], [160.0, 150.0], [150.0, 320.0]],
        "transition": 120.0,
        "wander": 30.0,
        "wavelength": 200.0,
    }

    other: Source = parameter(
        ..., "The other terrain: one to make, an earlier step, or a height.", unit="m"
    )
    line: list[list[float]] = parameter(
        ..., "Points [x, y] of the line between the two, in the world; two or more.", unit="m"
    )
    transition: float = parameter(
        1000.0, "Width of the strip in which one becomes the other.", unit="m", ge=0, le=1e8
    )
    wander: float = parameter(
        1200.0,
        "How far the seam strays from the line, so that it looks grown.",
        unit="m",
        ge=0,
        le=1e6,
    )
    wavelength: float = parameter(
        4000.0, "Distance between the largest bends of the seam.", unit="m", gt=0, le=1e8
    )
    seed: Seed = parameter(0, "Another number or word gives another seam.")

    presets: ClassVar = {
        "mountain_front": {"transition": 800.0, "wander": 2000.0},
        "gentle": {"transition": 5000.0, "wander": 2500.0, "wavelength": 8000.0},
        "ruler": {"transition": 0.0, "wander": 0.0},
    }

    @model_validator(mode="after")
    def _is_a_line(self) -> Self:
        if not 2 <= len(self.line) <= MOST_POINTS:
            raise ValueError(f"line: {len(self.line)} points; must be 2 to {MOST_POINTS}")
        for number, point in enumerate(self.line, 1):
            if len(point) != 2 or not all(abs(value) <= 1e9 for value in point):
                raise ValueError(f"line: point {number} is {point}; must be [x, y] within 1e9 m")
        for number, (a, b) in enumerate(pairwise(self.line), 1):
            if math.dist(a, b) < 1e-3:
                raise ValueError(
                    f"line: points {number} and {number + 1} are both {a}; leave one out"
                )
        where_it_crosses = crossing([(p[0], p[1]) for p in self.line])
        if where_it_crosses is not None:
            x, y = where_it_crosses
            raise ValueError(
                f"line: crosses itself at {x:g}, {y:g} (its ends run straight on for ever), so it "
                "has no left and right; move its points"
            )
        return self

    def height(self, place: Place, ground: Formula) -> Formula:
        """Return the height of this terrain, the other, or what is between."""
        other = place.terrain(self.other, "other")
        right = self._to_the_right(place)
        if self.wander > 0:
            words = place.words(f"{self.name} seam", self.seed)
            octaves = place.octaves("gradient", self.wavelength, 8, words)
            right = right + fbm(octaves) * self.wander
        half = 0.5 * max(self.transition, NARROWEST)
        share = smoothstep(-half, half, right)
        return where(share < 1.0, lerp(ground, other, share), other)

    def _to_the_right(self, place: Place) -> Formula:
        """Return the distance from the line, negative to its left."""
        count = len(self.line)
        middle = [sum(point[axis] for point in self.line) / count for axis in (0, 1)]
        x, y = place.around(middle)
        points = [(px - middle[0], py - middle[1]) for px, py in self.line]
        ways = [_way(a, b) for a, b in pairwise(points)]
        nearest: Formula | None = None
        side: Formula | None = None
        for k, (start, end) in enumerate(pairwise(points)):
            way, length = ways[k], math.dist(start, end)
            east, north = x - start[0], y - start[1]
            along, across = east * way[0] + north * way[1], east * way[1] - north * way[0]
            held, own = along, across
            # Nearest to a point of the line is what lies outside of its bend: between both normals
            if k > 0:
                held = maximum(held, 0.0)
                own = where(along <= 0.0, _across(x, y, start, ways[k - 1], way), own)
            if k < len(ways) - 1:
                held = minimum(held, length)
                own = where(along >= length, _across(x, y, end, way, ways[k + 1]), own)
            past = along - held
            distance = across * across + past * past
            if nearest is None or side is None:
                nearest, side = distance, own
                continue
            nearer = distance < nearest
            nearest, side = where(nearer, distance, nearest), where(nearer, own, side)
        assert nearest is not None
        assert side is not None
        return sqrt(nearest) * where(side < 0.0, -1.0, 1.0)


def _way(a: Vector, b: Vector) -> Vector:
    """Return the direction from one point to another."""
    length = math.dist(a, b)
    return (b[0] - a[0]) / length, (b[1] - a[1]) / length


def _across(x: Formula, y: Formula, point: Vector, before: Vector, after: Vector) -> Formula:
    """Return how far to the right of a bend in the line a place is; only the sign counts."""
    return (x - point[0]) * (before[1] + after[1]) - (y - point[1]) * (before[0] + after[0])
